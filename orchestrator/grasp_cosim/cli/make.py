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
"""What is said of a first build for other platforms."""

target_option = click.option(
    "--target",
    metavar="NAMES",
    help="Build for other platforms, too: linux64,win64,darwin64,aarch64-linux. Needs ziglang.",
)


@click.command()
@click.argument("block", required=False, type=PATH)
@click.option("-o", "--out", type=PATH, help=f"Folder for the FMUs. Default: {FMU_FOLDER}")
@click.option(
    "--native",
    is_flag=True,
    help=f"Build them as C, which needs no Python. Default of --out: {NATIVE_FOLDER}",
)
@target_option
@click.option("--fmi", type=click.Choice(["2", "3"]), help="FMI version of native FMUs. Default: 2")
@click.option(
    "--fingers", type=int, help="Build those of a hand with so many fingers alone, from 2 to 8."
)
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
    fingers: int | None,
    c_only: Path | None,
    as_json: bool,
) -> int:
    """Build the FMUs, in Python or as C.

    These are the plants, GripperPlant*, TandemPlant and HandPlant*, ProximitySensor,
    GraspController* and HandController*; the hand has three fingers, with --fingers as many as
    that, and the FMUs have the number in their names. With BLOCK, a Python file, the FMU of that
    block alone is built: my_plant.py becomes MyPlant.fmu; `init` writes one to start from. With
    --native, which translates the blocks to C and compiles them, BLOCK may also be the name of one
    of ours.

    It prints whether each file is new, changed or unchanged. Where pythonfmu has no binary for this
    machine, native FMUs are built beside them, too.

    \b
    Example: grasp-cosim build --out my_fmus
    Your own: grasp-cosim build my_plant.py
    Native: grasp-cosim build --native --target linux64,win64
    """
    from ..base.c_compilers import CompilerError  # only here: they take time to load
    from ..fmu_export.build import build_chosen, planned, write_c_only
    from ..fmu_export.native.targets import targets

    only_native = {"--target": target, "--fmi": fmi, "--c-only": c_only}
    for option, value in only_native.items():
        if value is not None and not native:
            raise InputError(f"{option} {value}: needs --native")
    if block:
        check_nature(block, "block")
    folder = out or (NATIVE_FOLDER if native else FMU_FOLDER)
    check_folder(c_only or folder)
    notes: list[str] = []
    try:
        if c_only:
            if target or fmi or out or fingers:
                raise ValueError("--c-only cannot be used with --target, --fmi, --fingers or --out")
            files = [str(path) for path in write_c_only(block, c_only)]
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
@click.option("-o", "--out", type=PATH, help="File to write, an .fmu.")
@click.option("--host", default=DEFAULTS.host, help="Address of its peer.")
@click.option(
    "--port", type=click.IntRange(1, 65535), default=DEFAULTS.port, help="UDP port of the peer."
)
@click.option("--timeout", type=float, default=DEFAULTS.timeout, help="Longest wait per step in s.")
@click.option("--name", default="", help="Name of the peer. Default: that of the component.")
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="NAME=LOW:HIGH[:RATE]",
    help="Of an input, what is sent at most; of an output, what is plausible; the rate is per s.",
)
@target_option
@click.option("--fmi", type=click.Choice(["2", "3"]), help="FMI version of the proxy. Default: 2")
@click.option("--c-header", type=PATH, help="Write the peer's side as a C99 header.")
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
    """Make a proxy of FMU, whose outputs come from a peer.

    It is an FMU with the same variables. It sends inputs and parameters in one UDP datagram per
    step and waits --timeout for the outputs. What happens without an answer is up to its parameters
    proxy.*, where --host, --port and --timeout are start values. The peer is grasp-cosim serve or a
    bench with the header of --c-header. A proxy is C and needs a compiler: gcc, or ziglang of
    grasp-cosim[native].

    \b
    Example: grasp-cosim proxy fmus/build/GripperPlant.fmu -o GripperPlantProxy.fmu --timeout 0.001
    For others: grasp-cosim proxy vendor.fmu -o Bench.fmu --target linux64,win64
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
