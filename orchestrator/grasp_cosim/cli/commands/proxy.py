"""The command proxy."""

from pathlib import Path

import click
from grasp_fmus.proxy import DEFAULTS, Settings

from ...base.errors import InputError
from ..frame import PATH, json_option, say, show, waiting
from .build import FIRST


@click.command()
@click.argument("fmu", type=PATH)
@click.option("-o", "--out", type=PATH, help="File to write, an .fmu.")
@click.option("--host", default=DEFAULTS.host, show_default=True, help="Address of its peer.")
@click.option(
    "--port",
    type=click.IntRange(1, 65535),
    default=DEFAULTS.port,
    show_default=True,
    help="UDP port of the peer.",
)
@click.option(
    "--timeout",
    type=float,
    default=DEFAULTS.timeout,
    show_default=True,
    help="Longest wait per step in s.",
)
@click.option(
    "--target",
    metavar="NAMES",
    help="Build for other platforms, too: linux64,win64,darwin64,aarch64-linux. Needs ziglang.",
)
@click.option("--fmi", type=click.Choice(["2", "3"]), help="FMI version of the proxy. Default: 2")
@click.option("--c-header", type=PATH, help="Write the peer's side as a C99 header.")
@json_option
def proxy(
    fmu: Path,
    out: Path | None,
    host: str,
    port: int,
    timeout: float,
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
    from ...hil.proxy import write_peer_header, write_proxy  # only here: it takes time to load

    if out is None and c_header is None:
        raise InputError("proxy: needs -o FILE.fmu or --c-header FILE, or both")
    if out and c_header and out.resolve() == c_header.resolve():
        raise InputError(f"--c-header {c_header}: is the proxy; must be another file")
    for option, value in (("--target", target), ("--fmi", fmi)):
        if value is not None and out is None:
            raise InputError(f"{option} needs -o FILE.fmu")
    report: dict[str, object] = {}
    lines, notes = [], []
    if c_header:
        notes = write_peer_header(fmu, c_header)
        lines.append(f"{c_header}: written")
        report["c_header"] = str(c_header)
    if out:
        settings = Settings(host, port, timeout)
        targets = target.split(",") if target is not None else ()
        built, notes = write_proxy(
            fmu,
            out,
            settings,
            targets,
            3 if fmi == "3" else 2,
            lambda line: waiting(f"{line}{FIRST if target else ''}"),
        )
        lines.insert(0, f"{out}: {built.status}")
        report |= {"fmu": str(out), "status": built.status}
    for note in notes:
        say(note)
    show(as_json, {"notes": notes, **report}, "\n".join(lines))
    return 0
