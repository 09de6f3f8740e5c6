"""What any FMU says about itself: FMI 1.0, 2.0 or 3.0, from whichever tool."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from ..errors import choices
from ..interface.model_description import FROM_TYPE, read_description

COLUMNS = (
    "name", "causality", "variability", "type", "unit", "start", "range", "dependencies",
    "description",
)  # fmt: skip
EXPERIMENT = {
    "start_time": "startTime", "stop_time": "stopTime", "tolerance": "tolerance",
    "step_size": "stepSize",
}  # fmt: skip
WIDEST = 32
"""Between name and description, the width of a column where the width of the table is limited."""

KINDS = {
    "CoSimulation": "co-simulation",
    "ModelExchange": "model exchange",
    "ScheduledExecution": "scheduled execution",
}
_ALL_2 = """needsExecutionTool canBeInstantiatedOnlyOncePerProcess canGetAndSetFMUstate
    canSerializeFMUstate canNotUseMemoryManagementFunctions providesDirectionalDerivative """
_ALL_3 = """needsExecutionTool canBeInstantiatedOnlyOncePerProcess canGetAndSetFMUState
    canSerializeFMUState providesDirectionalDerivatives providesAdjointDerivatives
    providesPerElementDependencies """
FLAGS = {
    ("1", "CoSimulation"): """canHandleVariableCommunicationStepSize canHandleEvents canRejectSteps
        canInterpolateInputs maxOutputDerivativeOrder canRunAsynchronuously canSignalEvents
        canBeInstantiatedOnlyOncePerProcess canNotUseMemoryManagementFunctions""",
    ("2", "CoSimulation"): _ALL_2 + """canHandleVariableCommunicationStepSize
        canInterpolateInputs maxOutputDerivativeOrder canRunAsynchronuously""",
    ("2", "ModelExchange"): _ALL_2 + "completedIntegratorStepNotNeeded",
    ("3", "CoSimulation"): _ALL_3 + """canHandleVariableCommunicationStepSize
        fixedInternalStepSize maxOutputDerivativeOrder recommendedIntermediateInputSmoothness
        providesIntermediateUpdate mightReturnEarlyFromDoStep hasEventMode
        canReturnEarlyAfterIntermediateUpdate providesEvaluateDiscreteStates""",
    ("3", "ModelExchange"): _ALL_3 + "needsCompletedIntegratorStep providesEvaluateDiscreteStates",
    ("3", "ScheduledExecution"): _ALL_3,
}  # fmt: skip
"""The capabilities that each version of FMI has for each kind."""
NUMBERS: dict[str, tuple[str, str | None]] = {
    "maxOutputDerivativeOrder": ("Integer", "0"),
    "recommendedIntermediateInputSmoothness": ("Integer", "0"),
    "fixedInternalStepSize": ("Real", None),
}
"""Those that are no booleans: type and default."""


def inspect_fmu(path: Path) -> dict[str, Any]:
    """What the FMU at path declares, ready for JSON; InputError where there is no FMU.

    `dependencies` is null where an output declares none, which means all inputs in FMI.
    """
    model, root, files = read_description(path)
    kinds = [key for key in KINDS if getattr(model, key[0].lower() + key[1:])]
    return {
        "fmu": str(path),
        "model_name": model.modelName,
        "fmi_version": model.fmiVersion,
        "kinds": [KINDS[key] for key in kinds],
        "generation_tool": model.generationTool,
        "guid": model.guid,
        "default_experiment": {
            key: _typed("Real", getattr(model.defaultExperiment, name, None))
            for key, name in EXPERIMENT.items()
        },
        "platforms": _platforms(files),
        "python": "resources/slavemodule.txt" in files,
        "capabilities": _capabilities(root, model.fmiVersion[0], kinds),
        "variables": _variables(model, root),
    }


def as_text(report: Mapping[str, Any], width: int | None = None) -> str:
    """The report as a head and a table; width, as of the terminal, cuts the descriptions."""
    experiment = [
        f"{key.partition('_')[0]} {_shown(value)}"
        for key, value in report["default_experiment"].items()
        if value is not None
    ]
    able = [
        flag if value is True else f"{flag} = {_shown(value)}"
        for flag, value in report["capabilities"].items()
        if value
    ]
    head = {
        "model": _shown(report["model_name"]) or "not declared",
        "FMI version": report["fmi_version"],
        "kinds": ", ".join(report["kinds"]) or "none",
        "generation tool": _shown(report["generation_tool"]) or "not declared",
        "GUID": _shown(report["guid"]) or "not declared",
        "default experiment": ", ".join(experiment) or "none",
        "platforms": ", ".join(report["platforms"]) or "none",
        "Python": "yes, made with pythonfmu" if report["python"] else "no",
        "capabilities": ", ".join(able) or "none",
    }
    lines = [f"{label:20s}{text}" for label, text in head.items()]
    return "\n".join([*lines, "", *_table([_row(v) for v in report["variables"]], width)])


def _platforms(files: list[str]) -> list[str]:
    """The folders with a shared library right inside."""
    parts = [name.split("/") for name in files if name.endswith((".so", ".dll", ".dylib"))]
    return sorted({p[1] for p in parts if p[0] == "binaries" and len(p) == 3})


def _capabilities(root: ElementTree.Element, version: str, kinds: list[str]) -> dict[str, Any]:
    """Flag to value; where a later kind differs from the first, it has an entry of its own."""
    found: dict[str, Any] = {}
    for kind in kinds:
        element = root.find("Implementation//Capabilities" if version == "1" else kind)
        for flag in FLAGS.get((version, kind), "").split():
            type_, default = NUMBERS.get(flag, ("Boolean", "false"))
            value = _typed(type_, default if element is None else element.get(flag, default))
            if found.setdefault(flag, value) != value:
                found[f"{flag} ({KINDS[kind]})"] = value
    return found


def _variables(model: Any, root: ElementTree.Element) -> list[dict[str, Any]]:
    elements = {e.get("name"): e for e in root.iterfind("ModelVariables/*")}
    known: dict[str | None, list[Any] | None] = {
        u.variable.name: None if u.dependencies is None else [v.name for v in u.dependencies]
        for u in model.outputs
    }
    for name, element in elements.items():  # FMI 1.0, not read by FMPy
        if (direct := element.find("DirectDependency")) is not None:
            known[name] = [child.text for child in direct.iter("Name") if child.text]
    return [_variable(v, elements[(v.alias or v).name], known) for v in model.modelVariables]


def _variable(
    v: Any, element: ElementTree.Element, known: Mapping[str | None, list[Any] | None]
) -> dict[str, Any]:
    declared = {
        key: getattr(v, key) or element.get(key) or getattr(v.declaredType, key, None)
        for key in FROM_TYPE
    }
    return {
        "name": v.name,
        "causality": v.causality,
        "variability": v.variability,
        "initial": v.initial or None,
        "type": v.type,
        "dimensions": list(v.shape),
        "unit": declared["unit"],
        "display_unit": declared["displayUnit"],
        "start": _start(v, element),
        **{key: _typed(v.type, declared[key]) for key in ("min", "max", "nominal")},
        "items": _items(v),
        "dependencies": known.get(element.get("name")) if v.causality == "output" else None,
        "description": v.description,
    }


def _items(v: Any) -> dict[str, Any] | None:
    """Of an enumeration, its numbers by name."""
    if v.type != "Enumeration" or not v.declaredType:
        return None
    return {item.name: _typed("Integer", item.value) for item in v.declaredType.items}


def _start(v: Any, element: ElementTree.Element) -> Any:
    if not v.dimensions or v.start is None:
        return _typed(v.type, v.start)
    texts = [e.get("value") for e in element.findall("Start")] or v.start.split()
    return [_typed(v.type, text) for text in texts]


def _typed(type_: str, text: str | None) -> Any:
    """The value in its type; the text itself where it is none, and for what JSON has no number."""
    if text is None or type_ in {"String", "Binary", "Clock"}:
        return text
    if type_ == "Boolean":
        return {"true": True, "1": True, "false": False, "0": False}.get(text.strip(), text)
    try:
        number = float(text) if type_.startswith(("Real", "Float")) else int(text)
        return number if math.isfinite(number) else str(number)
    except (ValueError, OverflowError):
        return text


def _row(v: Mapping[str, Any]) -> list[str]:
    low, high = _shown(v["min"]), _shown(v["max"])
    range_ = f"{low} to {high}" if low and high else f"from {low}" if low else f"up to {high}"
    declared = "not declared" if v["dependencies"] is None else choices(v["dependencies"])
    cells = {
        **v,
        "type": v["type"] + (f"{v['dimensions']}" if v["dimensions"] else ""),
        "range": ", ".join(v["items"]) if v["items"] else range_ if low or high else "",
        "dependencies": declared if v["causality"] == "output" else "",
    }
    return [_shown(cells[column]) for column in COLUMNS]


def _shown(value: Any) -> str:
    """A value on one line, in few characters."""
    if isinstance(value, list):
        return choices(map(_shown, value), limit=8)
    if isinstance(value, bool):
        return str(value).lower()
    text = f"{value:.15g}" if isinstance(value, float) else str("" if value is None else value)
    return " ".join(text.split())


def _table(rows: list[list[str]], width: int | None) -> list[str]:
    if width is not None:
        rows = [[r[0], *(_cut(cell, WIDEST) for cell in r[1:-1]), r[-1]] for r in rows]
    rows = [list(COLUMNS), *rows]
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)][:-1]
    if width is not None:
        room = max(width - sum(widths) - 2 * len(widths), len(COLUMNS[-1]))
        rows = [[*r[:-1], _cut(r[-1], room)] for r in rows]
    form = "".join(f"{{:{w}}}  " for w in widths) + "{}"
    return [form.format(*row).rstrip() for row in rows]


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: width - 1] + "…"
