"""Writes what measures and calibrates the C of a block: an A2L file, and its side of XCP.

c_only.a2l.in is the file, ASAM MCD-2 MC 1.7.1, and c_only_xcp.h.in what the slave of c/xcp.h takes
of a block. Both are made of its declarations: units, ranges, meanings, and groups by the part of a
name before its dot, which are the layers of the controllers.
"""

import re
import sys
from collections.abc import Iterator, Sequence
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from ..contract import Enumeration, Variable
from ..link import Causality, Kind
from .bench_header import Group
from .text import UntranslatableError, comment_text

EVENT = "step"
LOOPBACK, PORT = "127.0.0.1", 5555
"""Where the example listens: the UDP port that masters take by default."""
SLAVE = Path(__file__).with_name("c") / "xcp.h"
ADDRESS, EPK_ADDRESS = 0x10000, 0xFFFF0000
"""Where the memory and the texts begin for a master."""

STATE = "state.numbers"
"""The name of the array of all that a block remembers."""

IDENTIFIER = re.compile(r"(?!\d)\w+(\[\d+\])*(\.(?!\d)\w+(\[\d+\])*)*", re.ASCII)
"""What the standard takes for a name."""

_SIZES: dict[Kind, int] = {"Real": 8, "Integer": 4, "Boolean": 1}
_DATATYPES: dict[Kind, str] = {"Real": "FLOAT64_IEEE", "Integer": "SLONG", "Boolean": "UBYTE"}
_RANGES: dict[Kind, tuple[float, float]] = {
    "Real": (-sys.float_info.max, sys.float_info.max),
    "Integer": (-(2**31), 2**31 - 1),
    "Boolean": (0, 1),
}
_IN_MEMORY: tuple[Causality, ...] = ("parameter", "input", "output")
"""The structs in the memory, in their order; the state is the last one."""


class Place(NamedTuple):
    """A variable in the memory: its name in C with that of its struct, and where it begins."""

    variable: Variable
    name: str
    kind: Kind
    member: str
    offset: int


class Layout(NamedTuple):
    """The memory of a block, as compilers for 64-bit systems and for ARM lay it out."""

    places: list[Place]
    offsets: dict[str, int]
    """Where each struct begins, by what it is of."""
    size: int


def layout(groups: Sequence[Group], variables: Sequence[Variable], state_size: int) -> Layout:
    """Lay out the structs of a block: parameters, inputs, outputs, then its state."""
    by_name = {v.name: v for v in variables}
    by_causality = {group.causality: group for group in groups}
    places: list[Place] = []
    offsets: dict[str, int] = {}
    at = 0
    for causality in _IN_MEMORY:
        members = by_causality[causality].members
        alignment = max((_SIZES[link.kind] for link, _ in members), default=1)
        offsets[causality] = at = _aligned(at, alignment)
        for link, member in members:
            size = _SIZES[link.kind]
            at = _aligned(at, size)
            name = link.name if IDENTIFIER.fullmatch(link.name) else member
            place = f"{causality}s.{member}"
            places.append(Place(by_name[link.name], name, link.kind, place, at))
            at += size
        at = _aligned(at + (not members), alignment)  # C has a byte where there is nothing
    offsets["state"] = at = _aligned(at, 8)
    _check_names([STATE, *(place.name for place in places)])
    return Layout(places, offsets, at + 8 * state_size)


def _aligned(offset: int, size: int) -> int:
    return -(-offset // size) * size


def _check_names(names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise UntranslatableError(f"{name}: an A2L file would have it twice; must be unique")


def xcp_texts(name: str, memory: Layout) -> dict[str, str]:
    """Return what the templates for XCP need, by placeholder."""
    offsets = {f"{struct}s_offset": str(at) for struct, at in memory.offsets.items()}
    parameters = [p for p in memory.places if p.variable.causality == "parameter"]
    described = [
        f"        {{offsetof({name}_Parameters, {p.member.partition('.')[2]}), {_SIZES[p.kind]}, "
        f"{_truth(_is_tunable(p.variable))}, {_truth(p.kind == 'Boolean')}}},"
        for p in parameters
    ]
    return {
        **offsets,
        "state_offset": offsets["states_offset"],
        "memory_size": str(memory.size),
        "described": "\n".join(described or ["        {0, 0, false, false},"]),
        "count": str(len(described)),
        "address": f"{ADDRESS:#x}",
        "epk": epk(memory),
        "loopback": LOOPBACK,
        "symbol": f"{name}_memory",
    }


def epk(memory: Layout) -> str:
    """Return the text by which a master sees that a slave has these variables at these places."""
    lines = (f"{p.name} {p.kind} {p.variable.unit} {p.offset}\n" for p in memory.places)
    return sha256(f"{''.join(lines)}{memory.size}".encode()).hexdigest()[:16]


def _truth(value: bool) -> str:
    return str(value).lower()


def _is_tunable(variable: Variable) -> bool:
    return variable.variability == "tunable"


def a2l_texts(name: str, summary: str, memory: Layout) -> dict[str, str]:
    """Return what the A2L file of a block consists of, by placeholder of its template."""
    parameters = [p for p in memory.places if p.variable.causality == "parameter"]
    measured = [p for p in memory.places if p.variable.causality != "parameter"]
    state_size = (memory.size - memory.offsets["state"]) // 8
    longest_entry = _size("XCP_MAX_DTO") - 1 - _size("XCP_STAMP_SIZE")  # behind number and time
    return {
        "summary": _quoted(summary),
        "epk_address": f"{EPK_ADDRESS:#x}",
        "max_cto": str(_size("XCP_MAX_CTO")),
        "max_dto": str(_size("XCP_MAX_DTO")),
        "max_entry": str(longest_entry),
        "event": EVENT,
        "port": str(PORT),
        "conversions": "\n".join(_conversions(memory.places)),
        "characteristics": "\n".join(_characteristic(name, p) for p in parameters),
        "measurements": "\n".join(
            [*(_measurement(name, p) for p in measured), _state(name, memory, state_size)]
        ),
        "groups": "\n".join(_groups(memory.places)),
    }


def _size(name: str) -> int:
    """A size in bytes that the slave has."""
    found = re.search(rf"\b{name} = (\d+)", SLAVE.read_text("utf-8"))
    assert found is not None  # noqa: S101 - of our own header
    return int(found[1])


def _conversions(places: Sequence[Place]) -> Iterator[str]:
    """Yield a COMPU_METHOD for each unit, and for each set of words."""
    yield '    /begin COMPU_METHOD no_unit "" IDENTICAL "%.9" "" /end COMPU_METHOD'
    for unit in dict.fromkeys(p.variable.unit for p in places if p.variable.unit):
        yield (
            f'    /begin COMPU_METHOD {_conversion_of_unit(unit)} "" IDENTICAL "%.9" '
            f'"{_quoted(unit)}" /end COMPU_METHOD'
        )
    words = {p.variable.enumeration: None for p in places if p.variable.enumeration}
    for enumeration in words:
        yield from _words(enumeration.name, enumeration.items)
    if any(p.kind == "Boolean" for p in places):
        yield from _words("Boolean", (("false", 0), ("true", 1)))


def _words(name: str, items: Sequence[tuple[str, int]]) -> Iterator[str]:
    values = " ".join(f'{int(value)} "{_quoted(item)}"' for item, value in items)
    yield (
        f'    /begin COMPU_METHOD {name} "" TAB_VERB "%.0" "" COMPU_TAB_REF {name}.words '
        "/end COMPU_METHOD"
    )
    yield (f'    /begin COMPU_VTAB {name}.words "" TAB_VERB {len(items)} {values} /end COMPU_VTAB')


def _conversion_of_unit(unit: str) -> str:
    """The name of a conversion, in which the signs of a unit are words."""
    words = unit.replace("/", "_per_").replace(".", "_").replace("-", "_minus_")
    return f"in_{re.sub(r'[^A-Za-z0-9_]', lambda sign: f'_{ord(sign[0]):x}_', words)}"


def _conversion(p: Place) -> str:
    enumeration: Enumeration | None = p.variable.enumeration
    if enumeration:
        return enumeration.name
    if p.kind == "Boolean":
        return "Boolean"
    return _conversion_of_unit(p.variable.unit) if p.variable.unit else "no_unit"


def _limits(p: Place) -> str:
    """The lowest and the highest value; those of the type where none are declared, or infinite."""
    low, high = _RANGES[p.kind]
    if p.variable.limits:
        low, high = max(p.variable.limits[0], low), min(p.variable.limits[1], high)
    as_declared = float if p.kind == "Real" else int  # a named number is its number
    return f"{as_declared(low)!r} {as_declared(high)!r}"


def _characteristic(name: str, p: Place) -> str:
    access = "" if _is_tunable(p.variable) else " READ_ONLY"
    return (
        f'    /begin CHARACTERISTIC {p.name} "{_quoted(p.variable.description)}"\n'
        f"      VALUE {ADDRESS + p.offset:#x} {p.kind} 0 {_conversion(p)} {_limits(p)}{access}\n"
        f'      SYMBOL_LINK "{name}_memory.{p.member}" 0\n'
        "    /end CHARACTERISTIC"
    )


def _measurement(name: str, p: Place) -> str:
    return (
        f'    /begin MEASUREMENT {p.name} "{_quoted(p.variable.description)}"\n'
        f"      {_DATATYPES[p.kind]} {_conversion(p)} 0 0 {_limits(p)}\n"
        f"      ECU_ADDRESS {ADDRESS + p.offset:#x}\n"
        f'      SYMBOL_LINK "{name}_memory.{p.member}" 0\n'
        "    /end MEASUREMENT"
    )


def _state(name: str, memory: Layout, size: int) -> str:
    low, high = _RANGES["Real"]
    return (
        f'    /begin MEASUREMENT {STATE} "what the block remembers between steps"\n'
        f"      FLOAT64_IEEE no_unit 0 0 {low!r} {high!r}\n"
        f"      ECU_ADDRESS {ADDRESS + memory.offsets['state']:#x}\n"
        f"      MATRIX_DIM {size} 1 1\n"
        f'      SYMBOL_LINK "{name}_memory.state.numbers" 0\n'
        "    /end MEASUREMENT"
    )


def _groups(places: Sequence[Place]) -> Iterator[str]:
    """Yield a group for the parameters of each layer, and one each for what is measured."""
    layers: dict[str, list[str]] = {}
    measured: dict[str, list[str]] = {}
    for p in places:
        if p.variable.causality == "parameter":
            layer, dot, _ = p.name.partition(".")
            layers.setdefault(layer if dot else "parameters", []).append(p.name)
        else:
            measured.setdefault(f"{p.variable.causality}s", []).append(p.name)
    measured["states"] = [STATE]
    for group, names in layers.items():
        yield _group(group, "CHARACTERISTIC", names)
    for group, names in measured.items():
        yield _group(group, "MEASUREMENT", names)


def _group(name: str, what: str, names: Sequence[str]) -> str:
    listed = "".join(f"        {n}\n" for n in names)
    return (
        f'    /begin GROUP {name} "" ROOT\n      /begin REF_{what}\n{listed}'
        f"      /end REF_{what}\n    /end GROUP"
    )


def _quoted(text: str) -> str:
    """Text between quotes, in ASCII."""
    return comment_text(text).replace('"', "'")
