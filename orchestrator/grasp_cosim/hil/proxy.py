"""A proxy of an FMU, and the C header of its peer, made of the interface of the FMU."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from c_compilers import CompilerError
from grasp_fmus.description import Experiment
from grasp_fmus.variable import Enumeration
from grasp_fmus.variable import Variable as ProxyVariable

from ..base.errors import InputError, SimulationError
from ..base.files import check_file, write_text
from ..interface.interface import Interface, Value, Variable
from .protocol import exchanged, link_signature

if TYPE_CHECKING:
    from collections.abc import Callable

    from grasp_fmus.native.targets import Version
    from grasp_fmus.package import Built
    from grasp_fmus.proxy import Original, Settings

KINDS: Mapping[str, type[Value]] = {"Real": float, "Integer": int, "Boolean": bool}


def write_proxy(
    fmu: Path,
    out: Path,
    settings: Settings,
    targets: Sequence[str] = (),
    fmi: Version = 2,
    during: Callable[[str], AbstractContextManager[object]] = nullcontext,
) -> tuple[Built, list[str]]:
    """Write the proxy of an FMU; return what was built, and notes on it.

    settings are start values of its parameters; targets name the platforms that get a binary,
    beside this machine. `during` makes of a line that says what is done the context to do it in.
    InputError where the FMU or a setting does not permit it, SimulationError where the compiler
    fails.
    """
    from grasp_fmus.build import planned
    from grasp_fmus.native.targets import targets as found
    from grasp_fmus.proxy import build_proxy

    _check_other(fmu, out)
    interface = exchanged(fmu)
    signature, notes = link_signature(interface)
    original = _original(interface, [v.name for v in signature.variables])
    try:
        plan = planned(found(targets), fmi)
        with during(f"building for {', '.join(t.tuple for t in plan.places)}"):
            built = build_proxy(out, original, plan, settings)
    except ValueError as error:
        raise InputError(f"proxy: {error}") from error
    except CompilerError as error:
        raise SimulationError(str(error)) from error
    return built, [*notes, *([plan.note] if plan.note else [])]


def write_peer_header(fmu: Path, out: Path) -> list[str]:
    """Write the side of a proxy's peer as a C99 header; return notes on what is left out.

    InputError where the FMU does not permit it.
    """
    _check_other(fmu, out)
    interface = exchanged(fmu)
    try:
        write_text(out, _header(interface))
    except ValueError as error:
        raise InputError(f"proxy: {error}") from error
    return link_signature(interface)[1]


def _check_other(fmu: Path, out: Path) -> None:
    """InputError where a file would take the place of the FMU, or cannot be in its folder."""
    if out.resolve() == fmu.resolve():
        raise InputError(f"{out}: is the original; must be another file")
    check_file(out)


def _header(interface: Interface) -> str:
    """The C header of the peer."""
    from grasp_fmus.native.bench_header import bench_header

    signature, _ = link_signature(interface)
    starts = {v.name: _start(interface.by_name[v.name]) for v in signature.request}
    known = {name: start for name, start in starts.items() if start is not None}
    said = {v.name: v.description or "" for v in interface.variables}
    return bench_header(interface.identifier, signature, known, said)


def _original(interface: Interface, names: list[str]) -> Original:
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
