"""The bench side of a proxy FMU as one C99 header, for a target that is programmed in C.

link.h.in is the header itself, as C for a model called model; here it gets the name and the
variables. What it does is what link/peer.py does. Protocol: link/README.md
"""

import re
import struct
from collections.abc import Iterator, Mapping
from itertools import count
from pathlib import Path
from string import Template
from typing import NamedTuple

from .link.message import HEAD, STRING_SIZE, TAG_SIZE, Codec, Value, check_size
from .link.signature import HASH_SIZE, Causality, LinkVariable, Signature

TEMPLATE = Path(__file__).with_name("link.h.in")

LARGEST_REASON = 256
"""Bytes of a REFUSE's reason in C, as in the template."""

_TYPES = {"Real": "double", "Integer": "int32_t", "Boolean": "bool", "String": "char"}
_ZEROS: dict[str, Value] = {"Real": 0.0, "Integer": 0, "Boolean": False, "String": ""}
_PLURALS: dict[Causality, str] = {
    "input": "inputs",
    "parameter": "parameters",
    "output": "outputs",
}
_MEANINGS: dict[Causality, str] = {
    "input": "What the proxy sends with every request",
    "parameter": "What the proxy sends with every request as well; only tunable ones change",
    "output": "What it gets",
}

_TAKEN = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline
    int long register restrict return short signed sizeof static struct switch typedef union
    unsigned void volatile while

    alignas alignof and and_eq asm bitand bitor bool catch char8_t char16_t char32_t class co_await
    co_return co_yield compl concept const_cast consteval constexpr constinit decltype delete
    dynamic_cast explicit export false friend mutable namespace new noexcept not not_eq nullptr
    operator or or_eq private protected public reinterpret_cast requires static_assert static_cast
    template this thread_local throw true try typeid typename typeof typeof_unqual using virtual
    wchar_t xor xor_eq

    NULL I errno linux unix stdin stdout stderr assert offsetof
    """.split()  # noqa: SIM905 - a list of words is read as words
)
"""Words of C and C++, and macros, that no member may be called."""


class Member(NamedTuple):
    """A variable in C: what it is called, and where it begins in a body, in bytes."""

    variable: LinkVariable
    identifier: str
    offset: int


class Group(NamedTuple):
    """The variables of a causality; the body that holds them alone has size bytes."""

    prefix: str
    causality: Causality
    members: list[Member]
    size: int

    @property
    def plural(self) -> str:
        """What its struct and its functions are called."""
        return _PLURALS[self.causality]

    @property
    def struct(self) -> str:
        """The name of its struct."""
        return f"{self.prefix}_{self.plural}"


def c_header(
    name: str,
    signature: Signature,
    starts: Mapping[str, Value] | None = None,
    descriptions: Mapping[str, str] | None = None,
) -> str:
    """The header for the bench side of the proxy of the model of that name, as text in ASCII.

    starts are the start values of inputs and parameters by name, 0, false or empty where there is
    none; those of others are of no account. descriptions, by name, are for the comments. Everything
    in the header is called by the model's name in lower snake case, members by the variables' names
    with _ for what C cannot have; a name that was given already gets _2, _3, ...

    ValueError where the variables do not fit into a datagram, or a start value is none of its kind.
    """
    check_size(signature)
    prefix = c_prefix(name)
    inputs, parameters, outputs = groups = [_group(prefix, signature, c) for c in _PLURALS]
    text_size = len(signature.text.encode())
    said = descriptions or {}
    return Template(_named(TEMPLATE.read_text("utf-8"), prefix)).substitute(
        title=_comment(name),
        structs="\n".join(
            [_struct(inputs, said), _defaults(inputs, starts or {}), _struct(parameters, said),
             _defaults(parameters, starts or {}), _struct(outputs, said)]
        ),
        packing="\n".join(
            [_signature(prefix, signature), *map(_check, groups), _unpack(inputs),
             _unpack(parameters), _pack(outputs)]
        ),
        signature_size=text_size,
        inputs_size=inputs.size,
        parameters_size=parameters.size,
        outputs_size=outputs.size,
        answer_size=HEAD.size + TAG_SIZE + max(outputs.size, text_size, LARGEST_REASON),
    )  # fmt: skip


def c_prefix(name: str) -> str:
    """What everything in the header of the model of that name begins with: lower snake case."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name)
    return _identifier(words, "model").lower()


def _identifier(name: str, otherwise: str) -> str:
    """The name as an identifier of C; otherwise comes before a digit, and for a name of signs."""
    words = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return words if words[:1].isalpha() else f"{otherwise}_{words}".rstrip("_")


def _named(template: str, prefix: str) -> str:
    """The template with all that begins with model_ called after the model."""
    template = template.replace('"model.h"', f'"{prefix}.h"')
    template = re.sub(r"\bMODEL_", f"{prefix.upper()}_", template)
    return re.sub(r"\bmodel_", f"{prefix}_", template)


def _group(prefix: str, signature: Signature, causality: Causality) -> Group:
    members: list[Member] = []
    taken = set(_TAKEN)
    offset = 0
    for variable in signature.of(causality):
        wanted = _identifier(variable.name, "v")
        names = (f"{wanted}{suffix}" for suffix in _suffixes(wanted))
        identifier = next(n for n in names if n not in taken)
        taken.add(identifier)
        members.append(Member(variable, identifier, offset))
        offset += Codec([variable]).size
    return Group(prefix, causality, members, offset)


def _suffixes(wanted: str) -> Iterator[str]:
    """What makes another name of one that is taken."""
    yield ""
    if wanted in _TAKEN:
        yield "_"
    yield from (f"_{i}" for i in count(2))


def _struct(group: Group, descriptions: Mapping[str, str]) -> str:
    lines = [
        f"    {_declaration(m):<40} /* {_comment(_described(m.variable, descriptions))} */"
        for m in group.members
    ]
    none = f"    uint8_t none; /* the model has no {group.plural} */"
    return "\n".join(
        [f"/* {_MEANINGS[group.causality]} */", "typedef struct {", *(lines or [none]),
         f"}} {group.struct};", ""]
    )  # fmt: skip


def _declaration(m: Member) -> str:
    size = f"[{STRING_SIZE}]" if m.variable.kind == "String" else ""
    return f"{_TYPES[m.variable.kind]} {m.identifier}{size};"


def _described(v: LinkVariable, descriptions: Mapping[str, str]) -> str:
    named = f"{v.name}, {v.unit}" if v.unit else v.name
    description = descriptions.get(v.name)
    return f"{named}: {description.replace('·', '.')}" if description else named


def _defaults(group: Group, starts: Mapping[str, Value]) -> str:
    """The macro that initialises the struct."""
    values = [
        (_literal(m.variable, starts.get(m.variable.name, _ZEROS[m.variable.kind])), m.variable)
        for m in group.members
    ]
    last = len(values) - 1
    lines = [
        f"    {value + ('' if i == last else ','):<40} /* {_comment(v.name)} */ \\"
        for i, (value, v) in enumerate(values)
    ]
    return "\n".join(
        [f"#define {group.struct.upper()}_DEFAULTS {{ \\", *(lines or ["    0 \\"]), "}", ""]
    )


def _literal(v: LinkVariable, value: Value) -> str:
    """A start value in C."""
    try:
        packed = Codec([v]).unpack(Codec([v]).pack([value]))
    except (struct.error, OverflowError):
        packed = None
    if packed is None:
        raise ValueError(
            f"{v.name} = {value!r}, its start: must be a finite value of kind {v.kind}"
        )
    [start] = packed
    if isinstance(start, str):
        return _quoted(start)
    if isinstance(start, bool):
        return str(start).lower()
    return "(-2147483647 - 1)" if start == -(2**31) and v.kind == "Integer" else repr(start)


def _signature(prefix: str, signature: Signature) -> str:
    lines = [f"        {_quoted(line + chr(10))}," for line in signature.text.split("\n")[:-1]]
    octets = [f"0x{octet:02x}" for octet in signature.hash]
    return "\n".join(
        [
            "/* The first 16 bytes of the SHA-256 of the signature */",
            f"static inline const uint8_t *{prefix}_hash(void)",
            "{",
            f"    static const uint8_t hash[{HASH_SIZE}] = {{{', '.join(octets[:8])},",
            f"                                      {', '.join(octets[8:])}}};",
            "    return hash;",
            "}",
            "",
            f"/* The signature, {prefix.upper()}_SIGNATURE_SIZE bytes without a NUL */",
            f"static inline void {prefix}_signature(uint8_t *text)",
            "{",
            "    static const char *const lines[] = {",
            *lines,
            "        NULL,",
            "    };",
            "    size_t i, size;",
            "    for (i = 0; lines[i]; i++) {",
            "        size = strlen(lines[i]);",
            "        memcpy(text, lines[i], size);",
            "        text += size;",
            "    }",
            "}",
            "",
        ]
    )


def _check(group: Group) -> str:
    lines = []
    for m in group.members:
        lines += [
            f"    if (!{group.prefix}_is_{m.variable.kind.lower()}(body + {m.offset}))",
            f"        return {_quoted(m.variable.name)};",
        ]
    return _function(
        f"static inline const char *{group.prefix}_check_{group.plural}(const uint8_t *body)",
        [*(lines or ["    (void)body;"]), "    return NULL;"],
    )


def _unpack(group: Group) -> str:
    lines = []
    for m in group.members:
        get = f"{group.prefix}_get_{m.variable.kind.lower()}(body + {m.offset}"
        is_string = m.variable.kind == "String"
        lines.append(
            f"    {get}, values->{m.identifier});" if is_string
            else f"    values->{m.identifier} = {get});"
        )  # fmt: skip
    return _function(
        f"static inline void {group.prefix}_unpack_{group.plural}"
        f"(const uint8_t *body, {group.struct} *values)",
        lines or ["    (void)body, (void)values;"],
    )


def _pack(group: Group) -> str:
    lines = [
        f"    {group.prefix}_put_{m.variable.kind.lower()}(body + {m.offset}, "
        f"values->{m.identifier});"
        for m in group.members
    ]
    return _function(
        f"static inline void {group.prefix}_pack_{group.plural}"
        f"(const {group.struct} *values, uint8_t *body)",
        lines or ["    (void)values, (void)body;"],
    )


def _function(head: str, lines: list[str]) -> str:
    return "\n".join([head, "{", *lines, "}", ""])


def _quoted(text: str) -> str:
    """A string of C, the text in UTF-8; whatever needs it is written in octal."""
    return '"' + "".join(map(_escaped, text.encode())) + '"'


def _escaped(octet: int) -> str:
    if octet in b'"\\?' or not 0x20 <= octet < 0x7F:
        return {0x09: "\\t", 0x0A: "\\n"}.get(octet, f"\\{octet:03o}")
    return chr(octet)


def _comment(text: str) -> str:
    """The text for a comment, which it neither ends nor continues on another line."""
    plain = text.encode("ascii", "backslashreplace").decode()
    plain = "".join(c if c.isprintable() else "?" for c in plain)
    return plain.replace("*/", "* /").replace("/*", "/ *").replace("\\", "/").replace("??", "? ?")
