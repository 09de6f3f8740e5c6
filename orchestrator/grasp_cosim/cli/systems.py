"""The commands that write systems: init a file to start from, ssp an archive."""

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote
from typing import Any

import click

from ..base.checks import real
from ..base.errors import InputError, choices
from ..base.files import FMU_FOLDER, check_file, write_text
from ..inspection.block_templates import BLOCK_TEMPLATES, block_files, test_file_of
from ..inspection.draft import Draft, draft_of, system_of_fmus
from ..interface.read import read_interface
from ..system.description import System
from ..system.overrides import Override
from ..system.toml import to_do
from .frame import PATH, json_option, pair, say, show
from .options import SystemOptions, chosen_system, set_option

NAME = re.compile(r"[A-Za-z0-9_-]+")


@click.command()
@click.argument("file", type=PATH)
@click.option(
    "--as",
    "candidates",
    multiple=True,
    metavar="COMPONENT=FMU",
    help="Replace a component by a foreign FMU, with its names, units and values.",
)
@click.option(
    "--fmu", "fmus", multiple=True, metavar="NAME=FMU", help="Write a system of only these FMUs."
)
@click.option(
    "--fingers", type=int, help="Write the system of a hand with so many fingers, 2 to 8."
)
@click.option("--angles", metavar="A,B,...", help="Directions of the fingers of a hand in degrees.")
@click.option(
    "--tandem", is_flag=True, help="Write the system of a gripper in tandem on the wrist of an arm."
)
@click.option(
    "--delicate",
    is_flag=True,
    help="Write the system of delicate things that are grasped and lifted.",
)
@click.option(
    "--template",
    type=click.Choice([*BLOCK_TEMPLATES]),
    help="Write a block in Python and its test. `build` makes an FMU from the block.",
)
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@json_option
def init(
    file: Path,
    candidates: tuple[str, ...],
    fmus: tuple[str, ...],
    fingers: int | None,
    angles: str | None,
    tandem: bool,
    delicate: bool,
    template: str | None,
    force: bool,
    as_json: bool,
) -> int:
    """Write a system file, or a block in Python, to start from.

    FILE describes the built-in grasp. The command builds the FMUs in fmus/build next to FILE. With
    --as the command fills in the entries of a component for a foreign FMU. The word TODO marks the
    entries that you must complete. With --template, FILE is a block in Python with a test.

    \b
    Example: grasp-cosim init my_system.toml --as plant=vendor.fmu
    Use only one FMU: grasp-cosim init my_system.toml --fmu ball=BouncingBall.fmu
    Describe a hand: grasp-cosim init hand.toml --fingers 3 --angles 0,90,225
    Describe a gripper on an arm: grasp-cosim init tandem.toml --tandem
    Describe delicate things: grasp-cosim init delicate.toml --delicate
    Write a plant in Python: grasp-cosim init my_plant.py --template plant
    """
    if template:
        of_systems = {
            "--as": candidates,
            "--fmu": fmus,
            "--fingers": fingers,
            "--angles": angles,
            "--tandem": tandem,
            "--delicate": delicate,
        }
        for option, value in of_systems.items():
            if value:
                raise InputError(f"{option} cannot be used with --template, which is no system")
        return _write_block(file, template, force, as_json)
    if file.suffix.lower() != ".toml":
        kinds = choices([f"--template {kind}" for kind in BLOCK_TEMPLATES])
        block = f"; a block in Python has {kinds}" if file.suffix == ".py" else ""
        raise InputError(f"{file}: must end in .toml, a system file{block}")
    if file.is_file() and not force:
        raise InputError(f"{file}: is there already; give another name, or --force")
    check_file(file)
    foreign = _fmus_by_component("--as", candidates)
    alone_fmus = _fmus_by_component("--fmu", fmus)
    hand = fingers is not None or angles is not None
    systems = {
        "--fmu": bool(alone_fmus),
        "--fingers and --angles": hand,
        "--tandem": tandem,
        "--delicate": delicate,
    }
    _check_together(file, foreign, systems)
    drafts: dict[str, Draft] = {}
    notes: list[str] = []
    if alone_fmus:
        paths = {name: (fmu, path_from(file.parent, fmu)) for name, fmu in alone_fmus.items()}
        text, notes = system_of_fmus(paths)
    elif hand:
        text, notes = _hand_text(file.parent, fingers, angles)
    else:
        built_in_file = _built_in_file(tandem, delicate)
        text, drafts = _built_in_text(file.parent, built_in_file, foreign)
    write_text(file, text)
    unfilled = to_do(text)
    if not unfilled and file.is_file():
        try:
            System.load(file)
        except InputError as error:
            raise InputError(f"{file}: written, but not yet a system: {error}") from error
    report = {
        "file": str(file),
        "components": {name: _as_json(draft) for name, draft in drafts.items()},
        "todo": [{"line": number, "text": line} for number, line in unfilled.items()],
        "notes": notes,
    }
    show(as_json, report, "\n    ".join(_report_lines(file, drafts, unfilled)))
    for note in notes if not as_json else ():
        say(note)
    return 0


def _write_block(file: Path, kind: str, force: bool, as_json: bool) -> int:
    """Write a block in Python and its test; say how to go on."""
    from ..fmu_export.own_block import fmu_name  # only here: it takes time to load

    try:
        name = fmu_name(file)
    except ValueError as error:
        raise InputError(f"--template {kind}: {error}") from error
    written = block_files(file, kind)
    for path in written:
        if path.is_file() and not force:
            raise InputError(f"{path}: is there already; give another name, or --force")
        check_file(path)
    for path, text in written.items():
        write_text(path, text)
    fmu = FMU_FOLDER / f"{name}.fmu"
    swaps = " ".join(f"--swap {component}={fmu}" for component in BLOCK_TEMPLATES[kind].components)
    then = [
        f"grasp-cosim build {quote(str(file))}",
        f"grasp-cosim run --step 1e-3 {swaps}",
        f"python -m pytest {quote(str(test_file_of(file)))}",
    ]
    lines = [f"{path}: written" for path in written] + [f"    then: {line}" for line in then]
    show(as_json, {"files": [str(path) for path in written], "then": then}, "\n".join(lines))
    return 0


def _check_together(file: Path, foreign: Mapping[str, Path], kinds: Mapping[str, bool]) -> None:
    """InputError where options name two systems; `kinds` has them by the options that ask for them.

    Foreign FMUs may not be in the place of components of a hand, nor next to only FMUs.
    """
    if kinds["--fingers and --angles"] and foreign:
        fmus = " ".join(f"--swap {name}={quote(str(fmu))}" for name, fmu in foreign.items())
        raise InputError(
            "--fingers and --angles cannot be used with --as; write the system of the hand, then "
            f"`grasp-cosim run {quote(str(file))} {fmus}`"
        )
    if kinds["--fmu"] and foreign:
        raise InputError(
            "--fmu cannot be used with --as; --fmu makes a system of only these FMUs, "
            "--as puts one into the grasp"
        )
    requested = [option for option, is_requested in kinds.items() if is_requested]
    if len(requested) > 1:
        raise InputError(
            f"{requested[0]} cannot be used with {requested[1]}; each makes another system; "
            "must be one of them"
        )


def path_from(folder: Path, fmu: Path) -> str:
    """The path of an FMU in a file of a folder: relative to that where it is below or next to it.

    So the two can be moved together; one from elsewhere has an absolute path.
    """
    folder = folder.resolve()
    fmu = fmu.parent.resolve() / fmu.name
    is_below = fmu.is_relative_to(folder)
    is_beside = folder.parent != Path(folder.anchor) and fmu.is_relative_to(folder.parent)
    if is_below or is_beside:
        return Path(os.path.relpath(fmu, folder)).as_posix()
    return fmu.as_posix()


def _fmus_by_component(option: str, texts: tuple[str, ...]) -> dict[str, Path]:
    """The FMUs of an option by component."""
    fmus: dict[str, Path] = {}
    for text in texts:
        name, path = pair(option, text, "COMPONENT=FMU")
        if not NAME.fullmatch(name) or name in fmus:
            raise InputError(f"{option} {text!r}: must be a new name of letters, digits, _, -")
        fmus[name] = Path(path)
        read_interface(fmus[name])  # before any of ours is built
    return fmus


def _hand_text(folder: Path, fingers: int | None, angles: str | None) -> tuple[str, list[str]]:
    """The text of a hand, and the notes on it."""
    from ..grasp.system import built
    from ..hand.system import directions_of, faint, hand_text, sized

    try:
        degrees = None if angles is None else [real(angle) for angle in angles.split(",")]
    except ValueError:
        raise InputError(f"--angles {angles!r}: must be numbers in degrees, as 0,90,225") from None
    directions = directions_of(fingers, degrees)
    built(folder, sized(len(directions)))
    note = faint(directions)
    return _from_below(hand_text(directions)), [note] if note else []


def _built_in_file(tandem: bool, delicate: bool) -> Path:
    """The file of a built-in system."""
    from ..grasp.delicate import SYSTEM as DELICATE
    from ..grasp.presets import SYSTEM as GRASP
    from ..tandem.system import SYSTEM as TANDEM

    if tandem:
        return TANDEM
    return DELICATE if delicate else GRASP


def _built_in_text(
    folder: Path, file: Path, foreign: Mapping[str, Path]
) -> tuple[str, dict[str, Draft]]:
    """The text of a built-in system, with foreign FMUs in the place of components."""
    from ..grasp.system import built

    built_in = System.load(file, built(folder))
    text = _from_below(file.read_text("utf-8"))
    drafts = {}
    for name, fmu in foreign.items():
        built_in.component(name, f"--as {name}")
        keys = [key.partition(".") for preset in built_in.presets.values() for key in preset]
        preset = [variable for component, _, variable in keys if component == name]
        drafts[name] = draft_of(built_in, name, fmu, path_from(folder, fmu), preset)
        text = drafts[name].put_into(text)
    return text, drafts


def _from_below(text: str) -> str:
    """The text of a system file with its FMUs in the folder where they are built."""
    return re.sub(r'^fmu = "', f'fmu = "{FMU_FOLDER.as_posix()}/', text, flags=re.MULTILINE)


def _as_json(draft: Draft) -> dict[str, Any]:
    """The matches, doubts and units of a component that was filled in, for JSON."""
    return {
        "found": {name: match.variable.name for name, match in draft.matches.items()},
        "to_check": {name: match.doubt for name, match in draft.matches.items() if match.doubt},
        "units": {name: draft.foreign.by_name[name].unit for name in draft.matches},
    }


def _report_lines(
    file: Path, drafts: Mapping[str, Draft], unfilled: Mapping[int, str]
) -> list[str]:
    lines = [f"{file}: written"]
    for name, draft in drafts.items():
        doubtful = sum(bool(match.doubt) for match in draft.matches.values())
        check = f", {doubtful} of them to check: CHECK" if doubtful else ""
        lines.append(f"{name}: {len(draft.matches)} of the FMU's variables found{check}")
    lines += [f"line {number}: {line}" for number, line in unfilled.items()]
    then = "when no TODO is left" if unfilled else "then"
    return [*lines, f"{then}: grasp-cosim run {quote(str(file))}"]


@click.command()
@click.argument("system", required=False, type=PATH)
@click.option("-o", "--out", type=PATH, required=True, help="Archive to write (.ssp).")
@set_option
@json_option
def ssp(system: Path | None, out: Path, overrides: Sequence[Override], as_json: bool) -> int:
    """Write a system as an SSP 1.0 archive.

    SYSTEM is a .toml or .ssp file. The default is the built-in grasp. If an .ssp file contains no
    communication step, set it: --set experiment.step=1e-3.

    \b
    Example: grasp-cosim ssp my_system.toml -o my_system.ssp
    """
    from ..ssp.to_archive import write_ssp  # only here: its libraries take time to load

    chosen = chosen_system(SystemOptions(system=system, overrides=overrides))
    check_file(out)
    written = write_ssp(chosen, out)
    report = {
        "ssp": str(out),
        "entries": list(written.entries),
        "components": [c.name for c in chosen.components],
        "connections": len(chosen.connections),
        "notes": [*chosen.notes, *written.notes],
    }
    show(as_json, report, "\n    ".join((f"{out}: written", *written.entries)))
    if not as_json:
        for note in written.notes:
            say(note)
    return 0
