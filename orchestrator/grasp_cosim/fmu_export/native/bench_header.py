"""Writes the bench side of a proxy FMU as one C99 header, for a target that is programmed in C.

link.h.in is the header itself, as C for a model called model; here it gets the name and the
variables. It does what the peer in link does. wire.h.in is what it has in common with a native
proxy: datagrams, values and keys. Protocol: link/README.md
"""

import math
import re
import struct
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from itertools import chain, count
from pathlib import Path
from string import Template
from typing import NamedTuple

from .. import link
from ..link import (
    ORDER,
    TOO_LONG,
    Causality,
    Codec,
    Limit,
    LinkVariable,
    Signature,
    Value,
    check_name,
    check_size,
)
from .text import WORDS, comment_text, number, string

TEMPLATE = Path(__file__).with_name("link.h.in")
WIRE = Path(__file__).with_name("wire.h.in")

LARGEST_REASON = 256
"""Bytes of a REFUSE's reason in C, as in the template."""

_TYPES = {"Real": "double", "Integer": "int32_t", "Boolean": "bool"}
_ZEROS: dict[str, Value] = {"Real": 0.0, "Integer": 0, "Boolean": False}
_MEANINGS: dict[Causality, str] = {
    "input": "What the proxy sends with every request",
    "parameter": "What the proxy sends with every request too; only tunable ones change",
    "output": "What it gets",
}


class Group(NamedTuple):
    """The variables of a causality, with their identifiers in C."""

    prefix: str
    causality: Causality
    struct: str
    members: list[tuple[LinkVariable, str]]


def bench_header(
    name: str,
    signature: Signature,
    starts: Mapping[str, Value] | None = None,
    descriptions: Mapping[str, str] | None = None,
    limits: Mapping[str, Limit] | None = None,
    peer: str = "",
) -> str:
    """Return the header for the bench side of the proxy of the model `name`, as text in ASCII.

    `starts` are the start values of inputs and parameters by name, 0, false or empty where there is
    none; those of others are of no account. `descriptions`, by name, are for the comments; `limits`
    are of Real inputs, by name; `peer` is the name of this bench, empty for none. Names in
    the header begin with the model's in lower snake case; members are named after the variables,
    with _ for what C cannot have; a name that was given already gets _2, _3, ...

    ValueError where the variables do not fit into a datagram, or a start value is not of its kind.
    """
    check_size(signature)
    prefix = c_prefix(name)
    groups = [Group(prefix, c, f"{prefix}_{c}s", members(signature, c)) for c in ORDER]
    sizes = {f"{group.causality}s_size": 8 * len(group.members) for group in groups}
    pairs = [*((g, _CHECK) for g in groups), *zip(groups, (_UNPACK, _UNPACK, _PACK), strict=True)]
    return Template(_with_prefix(TEMPLATE.read_text("utf-8"), prefix)).substitute(
        title=comment_text(name),
        structs=structs(groups, _MEANINGS, starts or {}, descriptions or {}),
        wire=wire(prefix, signature),
        packing="\n".join(_function(group, *texts) for group, texts in pairs),
        limiting=_limiting(groups[0], limits or {}),
        name_text=string(check_name(peer)),
        too_long=TOO_LONG,
        answer_size=link.HEAD.size + link.TAG_SIZE + max(sizes["outputs_size"], LARGEST_REASON),
        **sizes,
    )


def wire(prefix: str, signature: Signature) -> str:
    """Return the part of the protocol that both sides need, in C; names begin with the prefix."""
    lines = [string(f"{line}\n") for line in signature.text.split("\n")[:-1]]
    octets = [f"0x{octet:02x}" for octet in signature.hash]
    return Template(_with_prefix(WIRE.read_text("utf-8"), prefix)).substitute(
        first_half_of_the_hash=", ".join(octets[:8]),
        second_half_of_the_hash=", ".join(octets[8:]),
        signature_lines="".join(f"        {line},\n" for line in lines),
        version=link.VERSION,
        hello_size=link.HELLO_SIZE,
        name_size=link.NAME_SIZE,
        build_size=link.BUILD_SIZE,
        largest_part=link.LARGEST_PART,
        longest_step=link.LONGEST_STEP,
        largest_key=link.LARGEST_KEY,
    )


def c_prefix(name: str) -> str:
    """Return the prefix of all names in the header of the model `name`, in lower snake case."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name)
    return _identifier(words, "model").lower()


def _identifier(name: str, otherwise: str) -> str:
    """Return the name as an identifier of C; `otherwise` precedes a digit, or mere signs."""
    words = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return words if words[:1].isalpha() else f"{otherwise}_{words}".rstrip("_")


def _with_prefix(template: str, prefix: str) -> str:
    template = template.replace('"model.h"', f'"{prefix}.h"')
    template = re.sub(r"\bMODEL_", f"{prefix.upper()}_", template)
    return re.sub(r"\bmodel_", f"{prefix}_", template)


def structs(
    groups: Iterable[Group],
    meanings: Mapping[Causality, str],
    starts: Mapping[str, Value],
    descriptions: Mapping[str, str],
) -> str:
    """Return the structs of groups in C, those that are set with a macro of their start values."""
    definitions = []
    for group in groups:
        lines = []
        for v, name in group.members:
            description = descriptions.get(v.name, "")
            text = comment_text(
                (f"{v.name}, {v.unit}" if v.unit else v.name) + (description and f": {description}")
            )
            lines.append(f"    {f'{_TYPES[v.kind]} {name};':<40} /* {text} */")
        head = f"/* {meanings[group.causality]} */\ntypedef struct {{"
        none = f"    uint8_t none; /* the model has no {group.causality}s */"
        definitions += [head, *(lines or [none]), f"}} {group.struct};", ""]
        if group.causality != "output":
            values = [_literal(v, starts.get(v.name, _ZEROS[v.kind])) for v, _ in group.members]
            padded = [f"{value}," for value in values[:-1]] + values[-1:]
            pairs = zip(padded, group.members, strict=True)
            lines = [f"    {value:<40} /* {comment_text(v.name)} */ \\" for value, (v, _) in pairs]
            head = f"#define {group.struct.upper()}_DEFAULTS {{ \\"
            definitions += [head, *(lines or ["    0 \\"]), "}", ""]
    return "\n".join(definitions)


def members(signature: Signature, causality: Causality) -> list[tuple[LinkVariable, str]]:
    """Return the variables of a causality, with their identifiers in C."""
    identifiers = []
    taken = set(WORDS)
    for variable in signature.of(causality):
        base_name = _identifier(variable.name, "v")
        endings = chain(["_"] if base_name in WORDS else [""], (f"_{i}" for i in count(2)))
        identifier = next(
            n for n in (f"{base_name}{ending}" for ending in endings) if n not in taken
        )
        taken.add(identifier)
        identifiers.append((variable, identifier))
    return identifiers


def _literal(v: LinkVariable, value: Value) -> str:
    packed = None
    with suppress(struct.error, OverflowError):
        packed = Codec([v]).unpack(Codec([v]).pack(value))
    if packed is None:
        must = f"must be a finite value of kind {v.kind}"
        raise ValueError(f"{v.name} = {value!r}, its start: {must}")
    [start] = packed
    if isinstance(start, bool):
        return str(start).lower()
    return "(-2147483647 - 1)" if start == -(2**31) and v.kind == "Integer" else repr(start)


_CHECK = (
    "const char *{prefix}_check_{causality}s(const uint8_t *body)",
    "    if (!{prefix}_is_{kind}(body + {at}))\n        return {text};",
    "(void)body;",
    "    return NULL;\n}",
)
_UNPACK = (
    "void {prefix}_unpack_{causality}s(const uint8_t *body, {struct} *values)",
    "    values->{name} = {prefix}_get_{kind}(body + {at});",
    "(void)body, (void)values;",
)
_PACK = (
    "void {prefix}_pack_{causality}s(const {struct} *values, uint8_t *body)",
    "    {prefix}_put_{kind}(body + {at}, values->{name});",
    "(void)values, (void)body;",
)


def _function(group: Group, head: str, line: str, unused: str, end: str = "}") -> str:
    begin = f"static inline {head.format_map(group._asdict())}\n{{"
    return "\n".join([begin, *lines_of(group, line, unused), end, ""])


def lines_of(group: Group, line: str, unused: str, first: int = 0) -> list[str]:
    """Return a line for each variable; `unused` where there is none.

    In it `at` is where the variable begins in a body, in bytes, `i` its place, counted from first.
    """
    lines = []
    for i, (v, name) in enumerate(group.members):
        kind, text = v.kind.lower(), string(v.name)
        number, truth = (" ? 1.0 : 0.0", " != 0.0") if v.kind == "Boolean" else ("", "")
        places = {"prefix": group.prefix, "kind": kind, "name": name, "text": text, "at": 8 * i}
        lines.append(line.format(**places, i=first + i, number=number, truth=truth))
    return lines or [f"    {unused}"]


def _limiting(inputs: Group, limits: Mapping[str, Limit]) -> str:
    """Return the function that keeps the inputs within their limits."""
    prefix, lines = inputs.prefix, []
    for v, name in inputs.members:
        limit = limits.get(v.name)
        if limit is None or v.kind != "Real":
            continue
        low, high = (number(_bounded(x)) for x in (limit.low, limit.high))
        lines.append(f"    limited += {prefix}_limit(&inputs->{name}, {low}, {high});")
        if math.isfinite(limit.rate):
            rate = f"{number(limit.rate)} * over_s"
            lines.append(f"    limited += over_s > 0.0 && {prefix}_limit(&inputs->{name},")
            lines.append(f"            before->{name} - {rate}, before->{name} + {rate});")
    unused = [] if lines else ["    (void)inputs, (void)before, (void)over_s;"]
    if lines and not any("before->" in line for line in lines):
        unused = ["    (void)before, (void)over_s;"]
    head = (
        f"static inline int {prefix}_limit_inputs({inputs.struct} *inputs,\n"
        f"        const {inputs.struct} *before, double over_s)\n{{\n    int limited = 0;"
    )
    return "\n".join([head, *unused, *lines, "    return limited;", "}"])


def _bounded(limit: float) -> float:
    """The limit as a number of C."""
    return math.copysign(min(abs(limit), sys.float_info.max), limit)
