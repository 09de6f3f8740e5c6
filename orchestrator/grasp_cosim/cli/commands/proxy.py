"""The command proxy."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click
from grasp_fmus.description import Experiment
from grasp_fmus.proxy import DEFAULTS, Settings
from grasp_fmus.variable import Enumeration
from grasp_fmus.variable import Variable as ProxyVariable

from ...errors import InputError, SimulationError
from ...files import check_folder, write_text
from ...hil.protocol import exchanged, link_signature
from ...interface.interface import Interface, Value, Variable
from ..frame import PATH, json_option, say, show, waiting
from .build import FIRST

if TYPE_CHECKING:
    from grasp_fmus.package import Built
    from grasp_fmus.proxy import Original

KINDS: Mapping[str, type[Value]] = {"Real": float, "Integer": int, "Boolean": bool}


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
    from c_compilers import CompilerError  # only here: they take time to load

    _check_paths(fmu, out, c_header)
    _check_options(out, {"--target": target, "--fmi": fmi})
    interface = exchanged(fmu)
    signature, notes = link_signature(interface)
    report: dict[str, object] = {"notes": notes}
    lines = []
    try:
        text = _header(interface) if c_header is not None else ""
        if out is not None:
            original = _original(interface, [v.name for v in signature.variables])
            built, said_of = _built(out, original, Settings(host, port, timeout), target, fmi)
            notes += said_of
            lines.append(f"{out}: {built.status}")
            report |= {"fmu": str(out), "status": built.status}
        if c_header is not None:
            write_text(c_header, text)
            lines.append(f"{c_header}: written")
            report["c_header"] = str(c_header)
    except ValueError as error:
        raise InputError(f"proxy: {error}") from error
    except CompilerError as error:
        raise SimulationError(str(error)) from error
    for note in notes:
        say(note)
    show(as_json, report, "\n".join(lines))
    return 0


def _header(interface: Interface) -> str:
    """The C header of the peer."""
    from grasp_fmus.bench_header import bench_header

    signature, _ = link_signature(interface)
    starts = {v.name: _start(interface.by_name[v.name]) for v in signature.request}
    known = {name: start for name, start in starts.items() if start is not None}
    said = {v.name: v.description or "" for v in interface.variables}
    return bench_header(interface.identifier, signature, known, said)


def _check_options(out: Path | None, only: Mapping[str, str | None]) -> None:
    """InputError where options are of an FMU, and there is none to make."""
    for option, value in only.items():
        if value is not None and out is None:
            raise InputError(f"{option} needs -o FILE.fmu")


def _built(
    out: Path, original: "Original", settings: Settings, target: str | None, fmi: str | None
) -> "tuple[Built, list[str]]":
    """The proxy, and what is to be said of it."""
    from grasp_fmus.build import planned
    from grasp_fmus.native.targets import targets
    from grasp_fmus.proxy import build_proxy

    plan = planned(targets(target.split(",")) if target is not None else (), 3 if fmi == "3" else 2)
    places = ", ".join(t.tuple for t in plan.places)
    with waiting(f"building for {places}{FIRST if target else ''}"):
        built = build_proxy(out, original, plan, settings)
    return built, [plan.note] if plan.note else []


def _check_paths(fmu: Path, out: Path | None, c_header: Path | None) -> None:
    """InputError where there is nothing to write, or it cannot be written there."""
    taken = {fmu.resolve(): "the original"}
    for option, path in (("-o", out), ("--c-header", c_header)):
        if path is None:
            continue
        if path.resolve() in taken:
            raise InputError(f"{option} {path}: is {taken[path.resolve()]}; must be another file")
        taken[path.resolve()] = "the proxy"
        check_folder(path.parent)
    if len(taken) == 1:
        raise InputError("proxy: needs -o FILE.fmu or --c-header FILE, or both")


def _original(interface: Interface, names: list[str]) -> "Original":
    """What a proxy has from the FMU; names are the variables to exchange, in order."""
    from grasp_fmus.proxy import Original

    known = {name for name in names if interface.by_name[name].causality != "output"}
    return Original(
        interface.path.name,
        [_variable(interface, interface.by_name[name], known) for name in names],
        interface.units,
        Experiment(*(None if v is None else float(v) for v in interface.experiment.values())),
        interface.can_vary_step,
    )


def _variable(interface: Interface, v: Variable, known: set[str]) -> ProxyVariable:
    """The variable in the proxy: an output follows inputs and parameters at the start only."""
    limits = (v.low, v.high)
    initially: tuple[str, ...] = ()
    if v.causality == "output":
        declared = v.dependencies if v.initial_dependencies is None else v.initial_dependencies
        inputs = {i.name for i in interface.of("input")}
        sources = known if declared is None else (known - inputs) | (known & set(declared))
        initially = tuple(u.name for u in interface.variables if u.name in sources)
    return ProxyVariable(
        v.name,
        KINDS[v.kind],
        v.causality,  # type: ignore[arg-type]  # one of the three that are exchanged
        v.unit or "",
        _start(v),
        v.variability,
        None if all(map(math.isinf, limits)) else limits,
        v.description or "",
        None if v.kind != "Real" or v.nominal == 1.0 else v.nominal,
        v.relative,
        initial_dependencies=initially,
        enumeration=Enumeration(v.enumeration.name, v.enumeration.items) if v.enumeration else None,
    )


def _start(v: Variable) -> Value | None:
    """Its start value; inputs and parameters have one in any case."""
    if v.start is None:
        return None if v.causality == "output" else KINDS[v.kind]()
    if v.kind == "Boolean":
        return v.start in ("true", "1")
    return KINDS[v.kind](v.start)
