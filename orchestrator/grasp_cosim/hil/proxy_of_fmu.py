"""A proxy of an FMU, and the C header of its peer: what the two exchange, from its interface."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from math import isfinite, isinf
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import InputError, SimulationError, nearest
from ..base.files import check_file, write_text
from ..fmu_export.link import (
    ALIVE,
    HEAD,
    LARGEST_HANDSHAKE,
    ORDER,
    TAG_SIZE,
    Limit,
    LinkVariable,
    Signature,
    check_size,
    exposed,
    read_key,
)
from ..interface.expansion import expanded
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.read import read_interface
from ..interface.variables import Variable
from ..system.times import NANOSECONDS

if TYPE_CHECKING:
    from ..fmu_export.contract import Variable as ProxyVariable
    from ..fmu_export.native.targets import Version
    from ..fmu_export.package import Built
    from ..fmu_export.proxy import Settings

LONGEST_SILENCE = ALIVE / NANOSECONDS
"""s after which another proxy may take over a session."""

WIDE_TYPES = ("UInt32", "Int64", "UInt64")
"""Integer types that an Integer of FMI 2.0 does not hold."""

TEXT = "a text, as the link has none"

VALUE_BYTES = 8
"""Bytes of a value in a datagram."""


def exchanged(fmu: Path) -> Interface:
    """Return the interface of an FMU, with elements in the place of arrays of numbers."""
    interface = read_interface(fmu)
    return interface if interface.sized_by is None else expanded(interface, {})


def link_signature(interface: Interface) -> tuple[Signature, list[str]]:
    """Return the signature of an FMU, and notes on what is left out.

    InputError where an input or output cannot be exchanged.
    """
    exchanged_variables: list[LinkVariable] = []
    left_out: dict[str, list[str]] = {}
    for v in interface.of(*ORDER, "structuralParameter"):
        reason = _obstacle(v)
        if reason is None:
            # no other kind and causality is left
            exchanged_variables.append(LinkVariable(v.name, v.kind, v.causality, v.unit))  # type: ignore[arg-type]
        elif v.causality in ("input", "output") and reason != TEXT:
            raise InputError(
                f"{interface.path}: {v.causality} {v.name} is {reason}, which a proxy cannot "
                "exchange; must be of 64 bit floating point, 32 bit, Boolean or an array of these"
            )
        else:
            left_out.setdefault(reason, []).append(v.name)
    file = interface.path.name
    notes = [f"{file}: {', '.join(v)}: {reason}: left out" for reason, v in left_out.items()]
    try:
        signature = Signature(tuple(exchanged_variables))
        check_size(signature)
    except ValueError as error:
        raise InputError(f"{interface.path}: {error}") from error
    return signature, notes


def read_limits(fmu: Path, texts: Sequence[str]) -> dict[str, Limit]:
    """Return limits from texts, NAME=LOW:HIGH:RATE, by name.

    InputError where one is none, or of no Real input or output of the FMU.
    """
    reals = [v.name for v in exchanged(fmu).of("input", "output") if v.kind == "Real"]
    limits: dict[str, Limit] = {}
    for text in texts:
        name, sign, limit = text.partition("=")
        if not sign or name not in reals:
            valid = nearest(name, reals)
            raise InputError(f"--limit {text}: {name}: no Real input or output of {fmu}; {valid}")
        try:
            limits[name] = Limit.read(limit)
        except ValueError as error:
            raise InputError(f"--limit {name}={error}") from error
    return limits


def shared_key(path: Path, say: Callable[[str], None]) -> bytes:
    """Return the key in a file, and say where others can read it.

    InputError where it is too short to be one.
    """
    try:
        key = read_key(path)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    if warning := exposed(path):
        say(warning)
    return key


def _obstacle(v: Variable) -> str | None:
    """Why a variable cannot be exchanged; None where it can."""
    if v.causality == "structuralParameter":
        return "structural"
    if not v.supported:
        return f"of type {v.nature}"
    if v.kind == "String":
        return TEXT
    if v.type in WIDE_TYPES:
        return f"of type {v.type}"
    if v.kind == "Real" and v.start is not None and not isfinite(float(v.start)):
        return f"{v.start} at the start"
    return None


PYTHON_TYPES: Mapping[str, type[Value]] = {"Real": float, "Integer": int, "Boolean": bool}


def write_proxy(
    fmu: Path,
    out: Path,
    settings: Settings,
    targets: Sequence[str] = (),
    fmi: Version = 2,
    limits: Mapping[str, Limit] | None = None,
    during: Callable[[str], AbstractContextManager[object]] = nullcontext,
) -> tuple[Built, list[str]]:
    """Write the proxy of an FMU; return what was built, and notes on it.

    settings and limits are start values of its parameters; targets name the platforms that get a
    binary, in addition to this machine. `during` makes of a line that says what is done the context
    to do it in. InputError where the FMU or a setting does not permit it, SimulationError where the
    compiler fails.
    """
    from ..base.c_compilers import CompilerError  # here, as below, what takes time to load
    from ..fmu_export.build import planned
    from ..fmu_export.description import Description, Experiment
    from ..fmu_export.native.targets import targets as targets_named
    from ..fmu_export.proxy import build_proxy

    _check_other(fmu, out)
    interface = exchanged(fmu)
    signature, notes = link_signature(interface)
    request_names = {v.name for v in signature.request}
    times = (None if v is None else float(v) for v in interface.experiment.values())
    original = Description(
        interface.path.name,
        "",
        [
            _variable(interface, interface.by_name[v.name], request_names)
            for v in signature.variables
        ],
        interface.units,
        interface.can_vary_step,
        experiment=Experiment(*times),
    )
    try:
        plan = planned(targets_named(targets), fmi)
        with during(f"building for {', '.join(t.tuple for t in plan.places)}"):
            built = build_proxy(out, original, plan, settings, limits or {})
    except ValueError as error:
        raise InputError(f"proxy: {error}") from error
    except CompilerError as error:
        raise SimulationError(str(error)) from error
    notes += _large(signature)
    if plan.note:
        notes.append(plan.note)
    return built, notes


def _large(signature: Signature) -> list[str]:
    """A note where a datagram of the session is taken apart on its way."""
    sizes = {"STEP": len(signature.request), "answer": len(signature.answer)}
    notes = []
    for name, count in sizes.items():
        size = HEAD.size + VALUE_BYTES * count + TAG_SIZE
        if size > LARGEST_HANDSHAKE:
            notes.append(
                f"each {name} has {size} bytes, over {LARGEST_HANDSHAKE}: networks take it apart, "
                "and some drop the parts"
            )
    return notes


def write_peer_header(
    fmu: Path, out: Path, limits: Mapping[str, Limit] | None = None, name: str = ""
) -> list[str]:
    """Write the side of a proxy's peer as a C99 header; return notes on what is left out.

    limits are of inputs, by name; those of outputs are the proxy's only. name is that of the peer.

    InputError where the FMU does not permit it.
    """
    from ..fmu_export.native.bench_header import bench_header

    _check_other(fmu, out)
    interface = exchanged(fmu)
    signature, notes = link_signature(interface)
    starts = {v.name: _start(interface.by_name[v.name]) for v in signature.request}
    declared = {name: start for name, start in starts.items() if start is not None}
    texts = {v.name: v.description or "" for v in interface.variables}
    header = (interface.identifier, signature, declared, texts, limits, name)
    try:
        write_text(out, bench_header(*header))
    except ValueError as error:
        raise InputError(f"proxy: {error}") from error
    return notes


def _check_other(fmu: Path, out: Path) -> None:
    """InputError where a file would take the place of the FMU, or cannot be in its folder."""
    if out.resolve() == fmu.resolve():
        raise InputError(f"{out}: is the original; must be another file")
    check_file(out)


def _variable(interface: Interface, v: Variable, request_names: set[str]) -> ProxyVariable:
    """The variable in the proxy: an output follows inputs and parameters at the start only."""
    from ..fmu_export.contract import Enumeration
    from ..fmu_export.contract import Variable as ProxyVariable

    limits = (v.low, v.high)
    initially: tuple[str, ...] = ()
    if v.causality == "output":
        declared = v.dependencies if v.initial_dependencies is None else v.initial_dependencies
        inputs = {i.name for i in interface.of("input")}
        sources = request_names
        if declared is not None:
            sources = (request_names - inputs) | (request_names & set(declared))
        initially = tuple(u.name for u in interface.variables if u.name in sources)
    return ProxyVariable(
        v.name,
        PYTHON_TYPES[v.kind],
        v.causality,  # type: ignore[arg-type]  # one of the three that are exchanged
        v.unit or "",
        _start(v),
        v.variability,
        None if all(map(isinf, limits)) else limits,
        v.description or "",
        None if v.kind != "Real" or v.nominal == 1.0 else v.nominal,
        v.relative,
        initial_dependencies=initially,
        enumeration=Enumeration(v.enumeration.name, v.enumeration.items) if v.enumeration else None,
    )


def _start(v: Variable) -> Value | None:
    """Its start value; inputs and parameters have one in any case."""
    if v.start is None:
        return None if v.causality == "output" else PYTHON_TYPES[v.kind]()
    if v.kind == "Boolean":
        return v.start in ("true", "1")
    return PYTHON_TYPES[v.kind](v.start)
