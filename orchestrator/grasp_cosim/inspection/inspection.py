"""The self-description of any FMU: FMI 1.0, 2.0 or 3.0, from whichever tool."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..base.errors import choices
from ..base.text import MAX_WIDTH as SCREEN
from ..base.text import on_a_screen
from ..interface.obstacles import FMU_KINDS, this_platform
from ..interface.read import describe
from ..interface.variables import Variable

COLUMNS = (
    "name", "causality", "variability", "type", "unit", "start", "range", "dependencies",
    "description",
)  # fmt: skip
WIDEST = 32
"""Between name and description, the width of a column where the width of the table is limited."""


class Report(dict[str, Any]):
    """The declarations of an FMU, ready for JSON; it shows itself as `inspect` does."""

    def __repr__(self) -> str:
        return on_a_screen(as_text(self, SCREEN).splitlines())


def inspect_fmu(path: str | Path) -> Report:
    """Read what an FMU declares.

    Args:
        path: The FMU.

    Returns:
        A dictionary ready for JSON. `dependencies` of an output are null where it declares none,
        which means all inputs in FMI. `sizes` of an array name by dimension the variable that holds
        the length, null where that is fixed.

    Raises:
        InputError: There is no FMU.
    """
    found = describe(Path(path))
    return Report(
        fmu=str(path),
        model_name=found.model_name,
        fmi_version=found.version,
        kinds=[FMU_KINDS[key] for key in found.kinds],
        generation_tool=found.tool,
        guid=found.guid or None,
        default_experiment=dict(found.experiment),
        platforms=list(found.platforms),
        this_machine=this_platform(found.version),
        sources=found.sources,
        python=found.python,
        capabilities=dict(found.capabilities),
        log_categories=list(found.log_categories),
        ambiguous=list(found.ambiguous),
        variables=[_variable(v) for v in found.variables],
    )


def as_text(report: Mapping[str, Any], width: int | None = None) -> str:
    """The report as a head and a table; width, as of the terminal, cuts the descriptions."""
    experiment = [
        f"{key.partition('_')[0]} {_shown(value)}"
        for key, value in report["default_experiment"].items()
        if value is not None
    ]
    able = list(_able(report["capabilities"]))
    platforms = ", ".join(report["platforms"]) or "none"
    head = {
        "model": _shown(report["model_name"]) or "not declared",
        "FMI version": report["fmi_version"],
        "kinds": ", ".join(report["kinds"]) or "none",
        "generation tool": _shown(report["generation_tool"]) or "not declared",
        "GUID": _shown(report["guid"]) or "not declared",
        "default experiment": ", ".join(experiment) or "none",
        "platforms": f"{platforms}; this machine: {report['this_machine']}",
        "sources": "yes, in C" if report["sources"] else "no",
        "Python": "needed, made with pythonfmu" if report["python"] else "not needed",
        "capabilities": ", ".join(able) or "none",
        "log categories": _shown(", ".join(report["log_categories"])) or "none",
        **({"several of one name": choices(several)} if (several := report["ambiguous"]) else {}),
    }
    lines = [f"{label:20s}{text}" for label, text in head.items()]
    return "\n".join([*lines, "", *_table([_row(v) for v in report["variables"]], width)])


def _able(capabilities: Mapping[str, Any]) -> Iterator[str]:
    """What the FMU is capable of; of a later kind what it does not share with the first one."""
    for flag, value in capabilities.items():
        name, _, later = flag.partition(" (")
        if value and not (later and capabilities.get(name) == value):
            yield flag if value is True else f"{flag} = {_shown(value)}"


def _variable(v: Variable) -> dict[str, Any]:
    needs = None if v.dependencies is None else list(v.dependencies)
    return {
        "name": v.name,
        "causality": v.causality,
        "variability": v.variability,
        "initial": v.initial,
        "type": v.type,
        "dimensions": list(v.shape),
        "sizes": list(v.sizes),
        "unit": v.unit,
        "display_unit": v.display_unit,
        "start": v.start_value,
        "min": v.minimum,
        "max": v.maximum,
        "nominal": v.magnitude,
        "items": v.items if v.enumeration else None,
        "dependencies": needs if v.causality == "output" else None,
        "description": v.description,
    }


def _row(v: Mapping[str, Any]) -> list[str]:
    return [
        _shown(v["name"]),
        v["causality"],
        v["variability"],
        v["type"] + _shape(v),
        _shown(v["unit"]),
        _start(v),
        _range(v),
        _dependencies(v),
        _shown(v["description"]),
    ]


def _start(v: Mapping[str, Any]) -> str:
    """The start value; of an enumeration the name of the item."""
    start = v["start"]
    if not v["items"]:
        return _shown(start)
    names = {number: name for name, number in v["items"].items()}
    if isinstance(start, list):
        return _shown([names.get(value, value) for value in start])
    return _shown(names.get(start, start))


def _range(v: Mapping[str, Any]) -> str:
    """The range of valid values; of an enumeration its items."""
    if v["items"]:
        return _shown(", ".join(v["items"]))
    low, high = _shown(v["min"]), _shown(v["max"])
    if low and high:
        return f"{low} to {high}"
    if low:
        return f"from {low}"
    return f"up to {high}" if high else ""


def _dependencies(v: Mapping[str, Any]) -> str:
    """What an output depends on directly."""
    if v["causality"] != "output":
        return ""
    return "not declared" if v["dependencies"] is None else choices(v["dependencies"])


def _shape(v: Mapping[str, Any]) -> str:
    """The shape of an array, like [3, 3] or, where variables hold the lengths, [n=3, m=2]."""
    if not v["dimensions"]:
        return ""
    lengths = [
        f"{name}={length}" if name else str(length)
        for name, length in zip(v["sizes"], v["dimensions"], strict=True)
    ]
    return f"[{', '.join(lengths)}]"


def _shown(value: Any) -> str:
    """A value on one line, in few characters."""
    if value is None:
        return ""
    if isinstance(value, str):
        return " ".join(value.split())
    if isinstance(value, list):
        return choices(map(_shown, value), limit=8)
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.15g}" if isinstance(value, float) else str(value)


def _table(rows: list[list[str]], width: int | None) -> list[str]:
    if width is not None:
        rows = [[r[0], *(_cut(cell, WIDEST) for cell in r[1:-1]), r[-1]] for r in rows]
    rows = [list(COLUMNS), *rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
    if width is not None:
        room = max(width - sum(widths) - 2 * len(widths), len(COLUMNS[-1]))
        rows = [[*r[:-1], _cut(r[-1], room)] for r in rows]
    form = "".join(f"{{:{w}}}  " for w in widths) + "{}"
    return [form.format(*row).rstrip() for row in rows]


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: width - 1] + "…"
