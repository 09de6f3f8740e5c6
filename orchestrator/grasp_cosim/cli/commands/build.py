"""The command build."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from ...errors import InputError, SimulationError
from ...files import FMU_FOLDER, NATIVE_FOLDER, check_folder
from ...interface.obstacles import of_binary
from ...interface.read import describe
from ..frame import PATH, json_option, say, show, waiting

if TYPE_CHECKING:
    from grasp_fmus.package import Built

FIRST = "; zig makes its libraries first, once, which takes a minute or two"
"""Of a first build for other platforms."""


@click.command()
@click.argument("block", required=False, type=PATH)
@click.option("-o", "--out", type=PATH, help=f"Folder for the FMUs. Default: {FMU_FOLDER}")
@click.option(
    "--native",
    is_flag=True,
    help=f"Build them as C, which needs no Python. Default of --out: {NATIVE_FOLDER}",
)
@click.option(
    "--target",
    metavar="NAMES",
    help="Build for other platforms, too: linux64,win64,darwin64,aarch64-linux. Needs ziglang.",
)
@click.option("--fmi", type=click.Choice(["2", "3"]), help="FMI version of native FMUs. Default: 2")
@click.option(
    "--c-only",
    type=PATH,
    metavar="DIR",
    help="Write the C of the blocks alone, for real-time targets.",
)
@json_option
def build(
    block: Path | None,
    out: Path | None,
    native: bool,
    target: str | None,
    fmi: str | None,
    c_only: Path | None,
    as_json: bool,
) -> int:
    """Build the FMUs, in Python or as C.

    These are the plants, GripperPlant*, ProximitySensor, and the GraspController*. With BLOCK, a
    Python file, the FMU of that block alone is built: spring_plant.py becomes SpringPlant.fmu
    (docs/your_plant.md). With --native, which translates the blocks to C and compiles them, BLOCK
    may also be the name of one of ours.

    It prints whether each file is new, changed or unchanged. Where pythonfmu has no binary for this
    machine, native FMUs are built beside them, too.

    \b
    Example: grasp-cosim build --out my_fmus
    Your own: grasp-cosim build docs/spring_plant.py
    Native: grasp-cosim build --native --target linux64,win64
    """
    only_native = {"--target": target, "--fmi": fmi, "--c-only": c_only}
    for option, value in only_native.items():
        if value is not None and not native:
            raise InputError(f"{option} {value}: needs --native")
    folder = out or (NATIVE_FOLDER if native else FMU_FOLDER)
    check_folder(c_only or folder)
    notes: list[str] = []
    try:
        if c_only:
            if target or fmi or out:
                raise ValueError("--c-only cannot be used with --target, --fmi or --out")
            return _write_c(block, c_only, as_json)
        if native:
            built, notes = _native(block, folder, target, 3 if fmi == "3" else 2)
        else:
            built = _in_python(block, folder)
            if obstacle := of_binary(describe(built[0].path)):
                twins = folder.parent / NATIVE_FOLDER.name
                built = [*built, *_native(block, twins, None, 2)[0]]
                notes = [f"built native FMUs, too: {built[0].path} {obstacle.what}"]
    except ValueError as error:
        raise InputError(f"build: {error}") from error
    for note in notes:
        say(note)
    report = {str(b.path): {"status": b.status} for b in built}
    lines = (f"{b.path}: {b.status}" for b in built)
    made = {"fmus": list(report), "built": report, **({"notes": notes} if native else {})}
    show(as_json, made, "\n".join(lines))
    return 0


def _in_python(block: Path | None, folder: Path) -> "Sequence[Built]":
    from grasp_fmus.build import build as build_fmus
    from grasp_fmus.build import build_block

    with waiting(f"building {block or 'the FMUs'}"):
        if block:
            return [build_block(block, folder)]
        return build_fmus(folder)


def _native(
    block: Path | None, folder: Path, target: str | None, fmi: Literal[2, 3]
) -> "tuple[Sequence[Built], list[str]]":
    """What was built, and what is to be said of it."""
    from c_compilers import CompilerError
    from grasp_fmus.build import build_block, build_native, planned
    from grasp_fmus.native.targets import targets

    plan = planned(targets(target.split(",")) if target is not None else (), fmi)
    notes = [plan.note] if plan.note else []
    places = ", ".join(t.tuple for t in plan.places)
    try:
        with waiting(f"building for {places}{FIRST if target else ''}"):
            if block is None:
                return build_native(folder, plan), notes
            if _is_name(block):
                return build_native(folder, plan, [str(block)]), notes
            return [build_block(block, folder, plan)], notes
    except CompilerError as error:
        raise SimulationError(str(error)) from error


def _write_c(block: Path | None, folder: Path, as_json: bool) -> int:
    """Write the C of one block into the folder, of all into folders in it."""
    from grasp_fmus.build import chosen_names
    from grasp_fmus.native.c_only import write_c
    from grasp_fmus.own_block import own_model
    from grasp_fmus.package import shipped_model

    if block and not _is_name(block):
        with own_model(block) as model:
            written = write_c(folder, model)
    else:
        names = chosen_names([str(block)] if block else [])
        models = {name: shipped_model(name) for name in names}
        places = {name: folder if block else folder / name for name in names}
        written = [path for name in names for path in write_c(places[name], models[name])]
    files = [str(path) for path in written]
    show(as_json, {"files": files}, "\n".join(f"{file}: written" for file in files))
    return 0


def _is_name(block: Path) -> bool:
    """True where it is to be the name of a block that comes with the package, not a file."""
    return block.suffix == "" and block.name == str(block) and not block.exists()
