"""The self-description of any FMU: FMI 1.0, 2.0 or 3.0, from whichever tool."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..base.errors import choices
from ..base.text import MAX_WIDTH as SCREEN_WIDTH
from ..base.text import on_a_screen
from ..interface.obstacles import FMU_KINDS, this_platform
from ..interface.read import describe
from ..interface.variables import Variable

COLUMNS = (
    "name", "causality", "variability", "type", "unit", "start", "range", "dependencies",
    "description",
)  # fmt: skip
MAX_COLUMN_WIDTH = 32
"""Characters of a column between name and description, where the width of the table is limited."""

MAX_LIST_ITEMS = 8
"""So many values of an array are shown at most."""


class Declarations(dict[str, Any]):
    """What an FMU declares, ready for JSON; it shows itself as `inspect` does."""

    def __repr__(self) -> str:
        return on_a_screen(declarations_text(self, SCREEN_WIDTH).splitlines())


def inspect_fmu(path: str | Path) -> Declarations:
    """Read what an FMU declares.

    Args:
        path: The FMU.

    Returns:
        A dictionary ready for JSON. `dependencies` of an output are null where it declares none,
        which means all inputs in FMI. `sizes` of an array name by dimension the variable that holds
        the length, null where that is fixed.

    Raises:
        InputError: There is no FMU.

    Example:
        >>> from grasp_cosim import grasp_system, inspect_fmu
        >>> path = grasp_system(native=False).by_name["plant"].fmu
        >>> declarations = inspect_fmu(path)
    """
    interface = describe(Path(path))
    return Declarations(
        fmu=str(path),
        model_name=interface.model_name,
        fmi_version=interface.version,
        kinds=[FMU_KINDS[key] for key in interface.kinds],
        generation_tool=interface.tool,
        guid=interface.guid or None,
        default_experiment=dict(interface.experiment),
        platforms=list(interface.platforms),
        this_machine=this_platform(interface.version),
        sources=interface.sources,
        python=interface.python,
        capabilities=dict(interface.capabilities),
        log_categories=list(interface.log_categories),
        ambiguous=list(interface.ambiguous),
        variables=[_variable_entry(v) for v in interface.variables],
    )


def declarations_text(declarations: Mapping[str, Any], width: int | None = None) -> str:
    """What an FMU declares, as a head and a table of its variables.

    `width` is that of the terminal in characters, which cuts the descriptions; None cuts nothing.
    """
    head = _model_lines(declarations) | _ability_lines(declarations)
    if ambiguous := declarations["ambiguous"]:
        head["several of one name"] = choices(ambiguous)
    lines = [f"{label:20s}{text}" for label, text in head.items()]
    rows = [_table_row(variable) for variable in declarations["variables"]]
    return "\n".join([*lines, "", *_table_lines(rows, width)])


def _model_lines(declarations: Mapping[str, Any]) -> dict[str, str]:
    """What the FMU is and how it was made, by label."""
    experiment = [
        f"{key.partition('_')[0]} {_value_text(value)}"
        for key, value in declarations["default_experiment"].items()
        if value is not None
    ]
    return {
        "model": _value_text(declarations["model_name"]) or "not declared",
        "FMI version": declarations["fmi_version"],
        "kinds": ", ".join(declarations["kinds"]) or "none",
        "generation tool": _value_text(declarations["generation_tool"]) or "not declared",
        "GUID": _value_text(declarations["guid"]) or "not declared",
        "default experiment": ", ".join(experiment) or "none",
    }


def _ability_lines(declarations: Mapping[str, Any]) -> dict[str, str]:
    """Where the FMU runs and what it is capable of, by label."""
    platforms = ", ".join(declarations["platforms"]) or "none"
    return {
        "platforms": f"{platforms}; this machine: {declarations['this_machine']}",
        "sources": "yes, in C" if declarations["sources"] else "no",
        "Python": "needed, made with pythonfmu" if declarations["python"] else "not needed",
        "capabilities": ", ".join(_capabilities(declarations["capabilities"])) or "none",
        "log categories": _value_text(", ".join(declarations["log_categories"])) or "none",
    }


def _capabilities(declared: Mapping[str, Any]) -> Iterator[str]:
    """What the FMU is capable of; of a later kind what it does not share with the first one."""
    for flag, value in declared.items():
        name, _, later_kind = flag.partition(" (")
        is_shared = bool(later_kind) and declared.get(name) == value
        if value and not is_shared:
            yield flag if value is True else f"{flag} = {_value_text(value)}"


def _variable_entry(variable: Variable) -> dict[str, Any]:
    """What a variable declares, as JSON has it."""
    dependencies = None
    if variable.causality == "output" and variable.dependencies is not None:
        dependencies = list(variable.dependencies)
    declared_type = {
        "type": variable.type,
        "dimensions": list(variable.shape),
        "sizes": list(variable.sizes),
        "unit": variable.unit,
        "display_unit": variable.display_unit,
    }
    declared_values = {
        "start": variable.start_value,
        "min": variable.minimum,
        "max": variable.maximum,
        "nominal": variable.magnitude,
        "items": variable.items if variable.enumeration else None,
    }
    return {
        "name": variable.name,
        "causality": variable.causality,
        "variability": variable.variability,
        "initial": variable.initial,
        **declared_type,
        **declared_values,
        "dependencies": dependencies,
        "description": variable.description,
    }


def _table_row(variable: Mapping[str, Any]) -> list[str]:
    """The cells of a variable, one for each of COLUMNS."""
    return [
        _value_text(variable["name"]),
        variable["causality"],
        variable["variability"],
        variable["type"] + _shape(variable),
        _value_text(variable["unit"]),
        _start(variable),
        _range(variable),
        _dependencies(variable),
        _value_text(variable["description"]),
    ]


def _start(variable: Mapping[str, Any]) -> str:
    """The start value; of an enumeration the name of the item."""
    start = variable["start"]
    if not variable["items"]:
        return _value_text(start)
    names = {number: name for name, number in variable["items"].items()}
    if isinstance(start, list):
        return _value_text([names.get(value, value) for value in start])
    return _value_text(names.get(start, start))


def _range(variable: Mapping[str, Any]) -> str:
    """The range of valid values; of an enumeration its items."""
    if variable["items"]:
        return _value_text(", ".join(variable["items"]))
    low, high = _value_text(variable["min"]), _value_text(variable["max"])
    if low and high:
        return f"{low} to {high}"
    if low:
        return f"from {low}"
    return f"up to {high}" if high else ""


def _dependencies(variable: Mapping[str, Any]) -> str:
    """What an output depends on directly."""
    if variable["causality"] != "output":
        return ""
    return "not declared" if variable["dependencies"] is None else choices(variable["dependencies"])


def _shape(variable: Mapping[str, Any]) -> str:
    """The shape of an array, like [3, 3] or, where variables hold the lengths, [n=3, m=2]."""
    if not variable["dimensions"]:
        return ""
    lengths = [
        f"{name}={length}" if name else str(length)
        for name, length in zip(variable["sizes"], variable["dimensions"], strict=True)
    ]
    return f"[{', '.join(lengths)}]"


def _value_text(value: Any) -> str:
    """A value on one line, in few characters."""
    if value is None:
        return ""
    if isinstance(value, str):
        return " ".join(value.split())
    if isinstance(value, list):
        return choices(map(_value_text, value), limit=MAX_LIST_ITEMS)
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.15g}" if isinstance(value, float) else str(value)


def _table_lines(rows: list[list[str]], width: int | None) -> list[str]:
    """The lines of the table; a width in characters cuts all columns but that of the names."""
    if width is not None:
        rows = [
            [name, *(_cut(cell, MAX_COLUMN_WIDTH) for cell in cells), description]
            for name, *cells, description in rows
        ]
    rows = [list(COLUMNS), *rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
    if width is not None:
        separators = 2 * len(widths)
        room = max(width - sum(widths) - separators, len(COLUMNS[-1]))
        rows = [[*cells, _cut(description, room)] for *cells, description in rows]
    form = "".join(f"{{:{column_width}}}  " for column_width in widths) + "{}"
    return [form.format(*row).rstrip() for row in rows]


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: width - 1] + "…"
