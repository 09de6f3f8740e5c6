"""The kinds of FMUs and what they are capable of; obstacles to running one here, and the remedy.

The one place that says so: reading a system, loading an instance and `inspect` ask it.
"""

import re
from collections.abc import Mapping
from tempfile import gettempdir
from typing import NamedTuple
from xml.etree.ElementTree import Element

from ..base.errors import choices
from ..base.platforms import platform_folder, platform_tuple, python_processor
from .fmi_types import Value, typed
from .interface import Interface

FMU_KINDS = {
    "CoSimulation": "co-simulation",
    "ModelExchange": "model exchange",
    "ScheduledExecution": "scheduled execution",
}
"""The kinds as elements of a model description, and in words."""
NUMERIC_CAPABILITIES = {
    "maxOutputDerivativeOrder": "Integer",
    "recommendedIntermediateInputSmoothness": "Integer",
    "fixedInternalStepSize": "Real",
}
"""The capabilities that are no booleans, with their types."""

_OF_FMI_1 = (
    "canHandleVariableCommunicationStepSize", "canHandleEvents", "canRejectSteps",
    "canInterpolateInputs", "maxOutputDerivativeOrder", "canRunAsynchronuously",
    "canSignalEvents", "canBeInstantiatedOnlyOncePerProcess",
    "canNotUseMemoryManagementFunctions",
)  # fmt: skip
_OF_FMI_2 = (
    "needsExecutionTool", "canBeInstantiatedOnlyOncePerProcess",
    "canNotUseMemoryManagementFunctions", "canGetAndSetFMUstate", "canSerializeFMUstate",
    "providesDirectionalDerivative",
)  # fmt: skip
_OF_FMI_3 = (
    "needsExecutionTool", "canBeInstantiatedOnlyOncePerProcess", "canGetAndSetFMUState",
    "canSerializeFMUState", "providesDirectionalDerivatives", "providesAdjointDerivatives",
    "providesPerElementDependencies",
)  # fmt: skip
_CO_SIMULATION_2 = (
    *_OF_FMI_2, "canHandleVariableCommunicationStepSize", "canInterpolateInputs",
    "maxOutputDerivativeOrder", "canRunAsynchronuously",
)  # fmt: skip
_CO_SIMULATION_3 = (
    *_OF_FMI_3, "canHandleVariableCommunicationStepSize", "fixedInternalStepSize",
    "maxOutputDerivativeOrder", "recommendedIntermediateInputSmoothness",
    "providesIntermediateUpdate", "mightReturnEarlyFromDoStep",
    "canReturnEarlyAfterIntermediateUpdate", "hasEventMode", "providesEvaluateDiscreteStates",
)  # fmt: skip
_MODEL_EXCHANGE_2 = (*_OF_FMI_2, "completedIntegratorStepNotNeeded")
_MODEL_EXCHANGE_3 = (*_OF_FMI_3, "needsCompletedIntegratorStep", "providesEvaluateDiscreteStates")
CAPABILITIES: Mapping[tuple[str, str], tuple[str, ...]] = {
    ("1", "CoSimulation"): _OF_FMI_1,
    ("1", "ModelExchange"): (),
    ("2", "CoSimulation"): _CO_SIMULATION_2,
    ("2", "ModelExchange"): _MODEL_EXCHANGE_2,
    ("3", "CoSimulation"): _CO_SIMULATION_3,
    ("3", "ModelExchange"): _MODEL_EXCHANGE_3,
    ("3", "ScheduledExecution"): _OF_FMI_3,
}
"""The capabilities that the standard names, by version and kind of FMU."""

RUNNABLE_KINDS = ("CoSimulation", "ModelExchange")
"""The kinds that the master runs, the one it prefers first."""

TIME_BASED_CLOCKS = ("constant", "fixed", "calculated", "tunable", "changing", "countdown")
"""The variabilities of the interval of a clock that ticks by time."""

TIME_BASED = choices(TIME_BASED_CLOCKS, len(TIME_BASED_CLOCKS))

_LICENCE = re.compile(r"licen[cs]|dongle|flexlm|activation|not activated", re.IGNORECASE)

_SYMBOL = re.compile(r"undefined symbol:? \S+", re.IGNORECASE)
"""A function that the binary lacks: whatever it is called, it says nothing of a licence."""


class Obstacle(NamedTuple):
    """The reason why an FMU does not run here, a predicate, and what would help."""

    reason: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.reason}; {self.remedy}"


def kinds_of(root: Element, major: str) -> dict[str, Element]:
    """The kinds of an FMU, each with the element that has its capabilities."""
    if major == "1":
        implementation = root.find("Implementation")
        if implementation is None:
            return {"ModelExchange": Element("Capabilities")}
        capabilities = implementation.find(".//Capabilities")
        return {"CoSimulation": implementation if capabilities is None else capabilities}
    elements = {kind: root.find(kind) for kind in FMU_KINDS}
    return {kind: element for kind, element in elements.items() if element is not None}


def capabilities_of(kinds: Mapping[str, Element], major: str) -> dict[str, Value | None]:
    """All capabilities of the kinds; one that is not declared has the standard's default value.

    Those of the first kind are under their names, those of a later one as 'FLAG (model exchange)'.
    """
    capabilities: dict[str, Value | None] = {}
    first = next(iter(kinds), "")
    for kind, element in kinds.items():
        flags = dict.fromkeys(CAPABILITIES.get((major, kind), ()))
        for flag in flags | element.attrib:
            if flag == "modelIdentifier":
                continue
            text = element.get(flag)
            value = (
                _default(flag)
                if text is None
                else typed(NUMERIC_CAPABILITIES.get(flag, "Boolean"), text)
            )
            capabilities[flag if kind == first else f"{flag} ({FMU_KINDS[kind]})"] = value
    return capabilities


def _default(flag: str) -> Value | None:
    """The value of a capability that is not declared; None for a step that is not fixed."""
    if flag not in NUMERIC_CAPABILITIES:
        return False
    return 0 if NUMERIC_CAPABILITIES[flag] == "Integer" else None


def this_machine(version: str) -> str:
    """The folder for binaries of this machine in an FMU of that version of FMI."""
    return platform_tuple() if version.startswith("3") else platform_folder()


def platform_of(folder: str, processor: str) -> str:
    """The platform of a binary in a folder of an FMU, as others than x86-64 are told apart.

    FMI 2.0 has one folder for all processors of 64 bit.
    """
    if folder != "linux64" or processor in ("", "x86-64"):
        return folder
    return f"{folder} ({processor})"


def this_platform(version: str) -> str:
    """That of this Python."""
    return platform_of(this_machine(version), python_processor())


def of_kind(fmu: Interface) -> Obstacle | None:
    """The obstacle that no machine removes: a version of FMI, a kind or a clock not supported."""
    runnable = " or ".join(FMU_KINDS[kind] for kind in RUNNABLE_KINDS)
    remedy = f"ask the vendor for an export as FMI 2.0 or 3.0, for {runnable}"
    kinds = " and ".join(FMU_KINDS[kind] for kind in fmu.kinds)
    if fmu.version == "1.0":
        return Obstacle(f"is FMI 1.0, for {kinds}", remedy)
    if not set(RUNNABLE_KINDS) & set(fmu.kinds):
        reason = f"is for {kinds} only" if kinds else "declares no kind of FMU"
        return Obstacle(reason, remedy)
    return of_clocks(fmu)


def of_clocks(fmu: Interface) -> Obstacle | None:
    """The obstacle that is an input clock which the master cannot tick."""
    for v in fmu.input_clocks:
        variability = v.clock.variability if v.clock else ""
        noun = f"has the input clock {v.name!r}"
        if v.shape:
            return Obstacle(f"{noun}, an array", "must have scalar clocks")
        if variability == "triggered":
            return Obstacle(
                f"{noun}, which another FMU has to tick (intervalVariability = 'triggered')",
                f"must have clocks that tick by time, as clocks are not connected: {TIME_BASED}",
            )
        if variability not in TIME_BASED_CLOCKS:
            return Obstacle(
                f"{noun} with intervalVariability = {variability!r}", f"must be {TIME_BASED}"
            )
        if variability in ("constant", "fixed") and v.clock and v.clock.interval is None:
            return Obstacle(
                f"{noun}, {variability}, without an interval",
                "must declare intervalDecimal, or intervalCounter and resolution",
            )
        if "ModelExchange" not in fmu.kinds and fmu.capability("hasEventMode") is not True:
            return Obstacle(f"{noun}, which ticks in event mode", "must declare hasEventMode")
    return None


def of_binary(fmu: Interface) -> Obstacle | None:
    """The obstacle on this machine: the FMU has no binary for it."""
    local_platform = this_platform(fmu.version)
    if local_platform in fmu.platforms:
        return None
    if fmu.platforms:
        reason = f"has a binary for {choices(fmu.platforms)} only"
    elif fmu.sources:
        reason = "is source-only, C without a binary"
    else:
        reason = "has no binary at all"
    remedy = f"ask the vendor for an FMU with a binary for {local_platform}"
    if fmu.python and fmu.ours:
        remedy += ", or make a native one of its block: grasp-cosim build --native"
    if fmu.sources:
        from .source_code import why_not_compiled  # only here: most FMUs have a binary

        if problem := why_not_compiled(fmu):
            remedy += f"; its sources do not compile as they are: {problem}"
        else:
            remedy += ", or compile its sources: LDFLAGS=-Wl,--no-as-needed,-lm fmpy compile FMU"
    return Obstacle(f"{reason}; this machine: {local_platform}", remedy)


def of_loading(fmu: Interface, message: str) -> Obstacle | None:
    """The likely obstacle where an FMU does not instantiate, by its message, which may be empty."""
    tool = fmu.tool or "the tool that made it"
    if _LICENCE.search(_SYMBOL.sub("", message)):
        return Obstacle(
            "needs a licence on this machine",
            f"have that of {tool} found here, or ask the vendor for an export that needs none",
        )
    if fmu.capability("needsExecutionTool") is True and not fmu.python:  # which always says so
        return Obstacle(
            f"is a link to {tool} and needs it here (needsExecutionTool)",
            "install that and its licence, or ask the vendor for an export that runs by itself",
        )
    if "failed to map segment" in message:
        return Obstacle(
            f"was extracted to {gettempdir()}, on a file system without execution (noexec)",
            "set TMPDIR to a folder on another one",
        )
    return None
