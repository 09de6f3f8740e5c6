"""The kinds of FMUs, and the capabilities that each version of FMI has for each of them."""

from collections.abc import Mapping
from xml.etree.ElementTree import Element

from .interface import Value, typed

KINDS = {
    "CoSimulation": "co-simulation",
    "ModelExchange": "model exchange",
    "ScheduledExecution": "scheduled execution",
}
"""The kinds as elements of a model description, and in words."""
_ALL_2 = """needsExecutionTool canBeInstantiatedOnlyOncePerProcess canGetAndSetFMUstate
    canSerializeFMUstate canNotUseMemoryManagementFunctions providesDirectionalDerivative """
_ALL_3 = """needsExecutionTool canBeInstantiatedOnlyOncePerProcess canGetAndSetFMUState
    canSerializeFMUState providesDirectionalDerivatives providesAdjointDerivatives
    providesPerElementDependencies """
FLAGS = {
    ("1", "CoSimulation"): """canHandleVariableCommunicationStepSize canHandleEvents canRejectSteps
        canInterpolateInputs maxOutputDerivativeOrder canRunAsynchronuously canSignalEvents
        canBeInstantiatedOnlyOncePerProcess canNotUseMemoryManagementFunctions""",
    ("1", "ModelExchange"): "",
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


def kinds_of(root: Element, major: str) -> dict[str, Element]:
    """The kinds of an FMU, each with the element that has its capabilities."""
    if major == "1":
        implementation = root.find("Implementation")
        if implementation is None:
            return {"ModelExchange": root}
        capable = implementation.find(".//Capabilities")
        return {"CoSimulation": implementation if capable is None else capable}
    found = {kind: root.find(kind) for version, kind in FLAGS if version == major}
    return {kind: element for kind, element in found.items() if element is not None}


def capabilities_of(kinds: Mapping[str, Element], major: str) -> dict[str, Value | None]:
    """Flag to value; where a later kind differs from the first, it has an entry of its own."""
    found: dict[str, Value | None] = {}
    for kind, element in kinds.items():
        for flag in FLAGS[major, kind].split():
            type_, default = NUMBERS.get(flag, ("Boolean", "false"))
            value = typed(type_, element.get(flag, default))
            if found.setdefault(flag, value) != value:
                found[f"{flag} ({KINDS[kind]})"] = value
    return found
