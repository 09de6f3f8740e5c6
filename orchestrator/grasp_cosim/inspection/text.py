"""How a system file is written: entries of tables with their comments, and what is left to do.

What is not known is a TODO: as a value it is refused where the file is read, in a comment it is
nothing that a run needs.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from ..base.errors import choices
from ..base.plain_text import on_one_line
from ..interface.interface import Value, Variable

FEW = 6
"""Variables that a TODO names at most."""

ISOLATED = "in a process of its own, until you trust its binary"

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_FMU = re.compile(r'^(fmu = )"([^"]*)"', re.MULTILINE)


class Row(NamedTuple):
    """An entry of a table as TOML has it, and its comment; without a key a comment alone."""

    key: str
    value: str
    comment: str = ""

    @property
    def open(self) -> bool:
        """True if it is left to do."""
        return self.value.startswith('"TODO')


def table(heading: str, rows: Sequence[Row]) -> str:
    """The text of a table, comments below each other; empty without rows."""
    if not rows:
        return ""
    entries = [f"{key(r.key)} = {r.value}" if r.key else "" for r in rows]
    width = max((len(e) for e, r in zip(entries, rows, strict=True) if not r.open), default=0)
    lines = [
        f"{entry:{width if entry else 0}}  # {row.comment}".lstrip() if row.comment else entry
        for entry, row in zip(entries, rows, strict=True)
    ]
    return "\n".join([heading, *lines])


def component_table(name: str, path: str) -> str:
    """The table of a component with a foreign FMU."""
    rows = Row("fmu", quoted(path)), Row("isolation", quoted("process"), ISOLATED)
    return table(f"[components.{name}]", rows)


def with_paths(text: str, paths: Mapping[str, str]) -> str:
    """The text of a system file with other paths of FMUs, by the ones in it."""
    return _FMU.sub(lambda m: m[1] + quoted(paths.get(m[2], m[2])), text)


def quoted(text: str) -> str:
    """A string as TOML writes it."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def todo(what: str, names: Collection[str] = ()) -> str:
    """The value that says what is to be put in its place, and names what that may be."""
    return quoted(f"TODO: {what}: {choices(names, FEW)}" if names else f"TODO: {what}")


def number(value: Value) -> str:
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    return quoted(value) if isinstance(value, str) else repr(value)


def neat(value: Value) -> Value:
    """A converted number, to the 15 digits that it has."""
    return float(f"{value:.15g}") if isinstance(value, float) else value


def start(variable: Variable) -> Value:
    """The start value of a variable, in its type; zero, false or nothing where it has none."""
    zeros: dict[str, Value] = {"Boolean": False, "Integer": 0, "String": ""}
    zero = zeros.get(variable.kind, 0.0)
    value = variable.start_value
    return value if isinstance(value, type(zero)) else zero


def told(variable: Variable) -> str:
    """A comment on a variable: its causality, unit, items and description."""
    unit = "" if variable.unit in (None, "1") else str(variable.unit)
    items = [f"{number} {name}" for name, number in variable.items.items()]
    parts = [variable.causality, unit, choices(items, FEW) if items else ""]
    said = on_one_line(" ".join((variable.description or "").split()))
    return f"{', '.join(p for p in parts if p)}{said and f': {said}'}"


def a(variable: Variable) -> str:
    """A variable in a few words: an output in m, a Boolean input."""
    kind = "" if variable.kind == "Real" else f"{variable.type} "
    words = f"{kind}{variable.causality}{f' in {variable.unit}' if variable.unit else ''}"
    return f"{'an' if words[0] in 'aeiouEI' else 'a'} {words}"


def key(name: str) -> str:
    """A key of a table as TOML writes it."""
    return name if _BARE.fullmatch(name) else quoted(name)
