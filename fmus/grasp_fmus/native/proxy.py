"""Builds the native proxy of an FMU: what proxy_build builds, as C without Python."""

from collections.abc import Sequence
from pathlib import Path

from ..build import Plan, with_binaries
from ..c_header import wire
from ..link.message import Codec
from ..link.signature import Signature
from ..package import HASH, Built, write_members
from ..proxy import DEFAULTS, Settings, bounded, shared_signature
from ..proxy_build import Original, proxy_model
from ..variable import Variable
from .sources import proxy_sources, with_description
from .targets import Version
from .text import number, string

_KINDS = {float: "KIND_REAL", bool: "KIND_BOOLEAN", int: "KIND_INTEGER", str: "KIND_STRING"}
_WHOLE = (-(2.0**31), 2.0**31 - 1.0)
"""What an Integer of the link holds."""


def build_native_proxy(
    target: Path, original: Original, plan: Plan, settings: Settings = DEFAULTS
) -> Built:
    """Build the native proxy of an FMU for the platforms of a plan.

    ValueError as build_proxy; CompilerError where a compiler fails.
    """
    members = proxy_members(target, original, plan.fmi, settings)
    fmus = with_binaries([(target.stem, members)], plan, networked=True)
    return write_members(target, fmus[target.stem])


def proxy_members(
    target: Path, original: Original, fmi: Version, settings: Settings
) -> dict[str, bytes]:
    """Return its files but for the binaries, by name."""
    model = proxy_model(target, original, settings)
    description, name = model.description, model.description.name
    signature = shared_signature(original.variables)
    own = {
        "wire.h": f"{_LICENCE}#ifndef WIRE_H\n#define WIRE_H\n\n{_INCLUDED}\n"
        f"{wire('wire', signature)}\n#endif\n",
        "variables.h": _table(signature, description.variables),
    }
    return with_description(model, proxy_sources(name, original.file, own, HASH, fmi), fmi)


_LICENCE = "/* What a proxy and its peer say to each other, in bytes: README.md of the link. */\n"
_INCLUDED = "".join(
    f"#include <{header}.h>\n" for header in ("stdbool", "stddef", "stdint", "string")
)


def _table(signature: Signature, variables: Sequence[Variable]) -> str:
    """Return variables.h: all variables, and the texts that Strings begin with."""
    texts: list[str] = []
    rows = []
    for v in bounded(variables, len(signature.variables)):
        start: float = 0.0
        low, high = v.limits or (_WHOLE if v.kind is int else (0.0, 0.0))
        if v.kind is str:
            start = len(texts)
            texts.append(string(str(v.start or "")))
        elif v.start is not None:
            start = float(v.start)
        fixed = int(v.variability == "fixed")
        numbers = ", ".join(number(float(x)) for x in (low, high, start))
        rows.append(
            f"    {{{string(v.name)}, {string(v.in_unit)}, {_KINDS[v.kind]}, "
            f"{v.causality.upper()}, {fixed},\n"
            f"     {int(v.limits is not None or v.kind is int)}, {numbers}}},\n"
        )
    defined = {
        "N_REQUEST": len(signature.request),
        "N_ANSWER": len(signature.answer),
        "REQUEST_SIZE": Codec(signature.request).size,
        "ANSWER_SIZE": Codec(signature.answer).size,
        "N_VARIABLES": len(rows),
        "N_TEXTS": len(texts),
    }
    return (
        "/* The variables of a proxy, in the order of their value references. */\n"
        + "".join(f"#define {name} {value}\n" for name, value in defined.items())
        + '#include "variable.h"\n\n'
        + f"static const Variable variables[N_VARIABLES] = {{\n{''.join(rows)}}};\n\n"
        + "static const char *const texts[N_TEXTS + 1] = {\n"
        + "".join(f"    {text},\n" for text in texts)
        + '    ""};\n'
    )
