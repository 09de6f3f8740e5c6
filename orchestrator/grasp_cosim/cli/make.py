"""The commands that make FMUs: build those of blocks, proxy one for a peer."""

from pathlib import Path

import click

from ..base.errors import InputError, SimulationError
from ..base.files import FMU_FOLDER, NATIVE_FOLDER, check_folder, check_nature
from ..fmu_export.proxy import DEFAULTS, Settings
from ..interface.obstacles import of_binary
from ..interface.read import describe
from .frame import PATH, json_option, say, show, waiting

FIRST = "; zig makes its libraries first, once, which takes a minute or two"
"""The note on a first build for other platforms."""

target_option = click.option(
    "--target",
    metavar="PLATFORM,...",
    help="Build for these platforms, too: linux64,win64,darwin64,aarch64-linux. Needs the package "
    "ziglang.",
)


@click.command()
@click.argument("block", required=False, type=PATH)
@click.option("-o", "--out", type=PATH, help=f"Folder for the FMUs. Default: {FMU_FOLDER}.")
@click.option(
    "--native",
    is_flag=True,
    help=f"Build FMUs in C, which run without Python. Default of --out: {NATIVE_FOLDER}.",
)
@target_option
@click.option(
    "--fmi", type=click.Choice(["2", "3"]), help="FMI version of native FMUs. Default: 2."
)
@click.option(
    "--fingers", type=int, help="Build only the FMUs of a hand with so many fingers, 2 to 8."
)
@click.option(
    "--c-only",
    type=PATH,
    metavar="DIR",
    help="Write only the C code of the blocks to a folder, for real-time platforms.",
)
@click.option(
    "--a2l",
    is_flag=True,
    help="With --c-only: write an A2L file and an XCP slave, too, for calibration tools.",
)
@json_option
def build(
    block: Path | None,
    out: Path | None,
    native: bool,
    target: str | None,
    fmi: str | None,
    fingers: int | None,
    c_only: Path | None,
    a2l: bool,
    as_json: bool,
) -> int:
    """Build the FMUs of the blocks, in Python or in C.

    Without BLOCK the command builds all FMUs of this project: plants, sensor and controllers, also
    of the tandem and of a hand with three fingers. With BLOCK, a Python file, it builds one FMU:
    my_plant.py becomes MyPlant.fmu. `init --template` writes such a file.

    With --native the command translates the blocks to C and compiles them. BLOCK may then also be
    the name of a block of this project, such as GripperPlant.

    The command prints whether each file is new, changed or unchanged. If pythonfmu has no binary
    for this machine, the command builds native FMUs, too.

    \b
    Example: grasp-cosim build --out my_fmus
    Build one block: grasp-cosim build my_plant.py
    Build native FMUs: grasp-cosim build --native --target linux64,win64
    """
    from ..base.c_compilers import CompilerError  # only here: they take time to load
    from ..fmu_export.build import build_chosen, planned, write_c_only
    from ..fmu_export.native.targets import targets

    only_native = {"--target": target, "--fmi": fmi, "--c-only": c_only}
    for option, value in only_native.items():
        if value is not None and not native:
            raise InputError(f"{option} {value}: needs --native")
    if a2l and not c_only:
        raise InputError("--a2l: needs --native --c-only DIR")
    if block:
        check_nature(block, "block")
    folder = out or (NATIVE_FOLDER if native else FMU_FOLDER)
    check_folder(c_only or folder)
    notes: list[str] = []
    try:
        if c_only:
            if target or fmi or out or fingers:
                raise ValueError("--c-only cannot be used with --target, --fmi, --fingers or --out")
            files = [str(path) for path in write_c_only(block, c_only, a2l)]
            show(as_json, {"files": files}, "\n".join(f"{file}: written" for file in files))
            return 0
        if fingers is not None and block:
            raise ValueError(f"--fingers {fingers} cannot be used with {block}")
        plan, subject = None, str(block or "the FMUs")
        if native:
            platforms = targets(target.split(",")) if target is not None else ()
            plan = planned(platforms, 3 if fmi == "3" else 2)
            if plan.note:
                notes.append(plan.note)
            subject = f"for {', '.join(t.tuple for t in plan.places)}"
        with waiting(f"building {subject}{FIRST if target else ''}"):
            built = build_chosen(block, folder, plan, fingers)
            if not native and (obstacle := of_binary(describe(built[0].path))):
                built += build_chosen(block, folder.parent / NATIVE_FOLDER.name, planned(), fingers)
                notes.append(f"built native FMUs, too: {built[0].path} {obstacle.reason}")
    except ValueError as error:
        raise InputError(f"build: {error}") from error
    except CompilerError as error:
        raise SimulationError(str(error)) from error
    for note in notes:
        say(note)
    report = {str(b.path): {"status": b.status} for b in built}
    lines = (f"{b.path}: {b.status}" for b in built)
    outcome = {"fmus": list(report), "built": report, **({"notes": notes} if native else {})}
    show(as_json, outcome, "\n".join(lines))
    return 0


@click.command()
@click.argument("fmu", type=PATH)
@click.option("-o", "--out", type=PATH, help="FMU to write.")
@click.option(
    "--host", metavar="ADDRESS", default=DEFAULTS.host, help="Network address of the peer."
)
@click.option(
    "--port", type=click.IntRange(1, 65535), default=DEFAULTS.port, help="UDP port of the peer."
)
@click.option(
    "--timeout", type=float, default=DEFAULTS.timeout, help="Longest wait for an answer, in s."
)
@click.option("--name", default="", help="Name of the peer. Default: the name of the component.")
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="VARIABLE=LOW:HIGH:RATE",
    help="Permitted range of an input or output, and its greatest change per s. :RATE may be "
    "omitted.",
)
@target_option
@click.option("--fmi", type=click.Choice(["2", "3"]), help="FMI version of the proxy. Default: 2.")
@click.option("--c-header", type=PATH, help="C99 header to write, for the program of a peer.")
@json_option
def proxy(
    fmu: Path,
    out: Path | None,
    host: str,
    port: int,
    timeout: float,
    name: str,
    limits: tuple[str, ...],
    target: str | None,
    fmi: str | None,
    c_header: Path | None,
    as_json: bool,
) -> int:
    """Build a proxy FMU, which gets its outputs from a peer.

    The proxy has the variables of FMU. In each step it sends inputs and parameters to the peer in
    one UDP datagram, and waits for the outputs. Its parameters proxy.* determine the reaction to a
    missing answer. --host, --port and --timeout are start values of such parameters.

    The peer is `grasp-cosim serve`, or a program with the header of --c-header. The proxy is
    compiled from C: install gcc, or the extra `native`.

    \b
    Example: grasp-cosim proxy vendor.fmu -o Bench.fmu --timeout 0.001
    Build for Windows: grasp-cosim proxy vendor.fmu -o Bench.fmu --target win64
    """
    from ..hil.proxy_of_fmu import (  # it takes time to load
        read_limits,
        write_peer_header,
        write_proxy,
    )

    if out is None and c_header is None:
        raise InputError("proxy: needs -o FILE.fmu or --c-header FILE, or both")
    if out and c_header and out.resolve() == c_header.resolve():
        raise InputError(f"--c-header {c_header}: is the proxy; must be another file")
    for option, value in (("--target", target), ("--fmi", fmi)):
        if value is not None and out is None:
            raise InputError(f"{option} needs -o FILE.fmu")
    report: dict[str, object] = {}
    lines, notes = [], []
    bounds = read_limits(fmu, limits)
    if c_header:
        notes = write_peer_header(fmu, c_header, bounds, name)
        lines.append(f"{c_header}: written")
        report["c_header"] = str(c_header)
    if out:
        settings = Settings(host, port, timeout, name=name)
        targets = target.split(",") if target is not None else ()
        built, notes = write_proxy(
            fmu,
            out,
            settings,
            targets,
            3 if fmi == "3" else 2,
            bounds,
            lambda line: waiting(f"{line}{FIRST if target else ''}"),
        )
        lines.insert(0, f"{out}: {built.status}")
        report |= {"fmu": str(out), "status": built.status}
    for note in notes:
        say(note)
    show(as_json, {"notes": notes, **report}, "\n".join(lines))
    return 0
