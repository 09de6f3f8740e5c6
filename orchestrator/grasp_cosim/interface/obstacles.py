"""The kinds of FMUs and what they are capable of; obstacles to running one here, and the remedy.

The one place that says so: reading a system, loading an instance and `inspect` ask it.
"""

import platform
import re
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import gettempdir
from typing import NamedTuple
from xml.etree.ElementTree import Element

from ..base.errors import choices
from .fmi_types import Value, typed
from .interface import Interface
from .model_description import ELF_HEAD_BYTES

KINDS = {
    "CoSimulation": "co-simulation",
    "ModelExchange": "model exchange",
    "ScheduledExecution": "scheduled execution",
}
"""The kinds as elements of a model description, and in words."""
NUMBERS = {
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
CAPABILITIES: Mapping[tuple[str, str], tuple[str, ...]] = {
    ("1", "CoSimulation"): _OF_FMI_1,
    ("1", "ModelExchange"): (),
    ("2", "CoSimulation"): (
        *_OF_FMI_2, "canHandleVariableCommunicationStepSize", "canInterpolateInputs",
        "maxOutputDerivativeOrder", "canRunAsynchronuously",
    ),
    ("2", "ModelExchange"): (*_OF_FMI_2, "completedIntegratorStepNotNeeded"),
    ("3", "CoSimulation"): (
        *_OF_FMI_3, "canHandleVariableCommunicationStepSize", "fixedInternalStepSize",
        "maxOutputDerivativeOrder", "recommendedIntermediateInputSmoothness",
        "providesIntermediateUpdate", "mightReturnEarlyFromDoStep",
        "canReturnEarlyAfterIntermediateUpdate", "hasEventMode", "providesEvaluateDiscreteStates",
    ),
    ("3", "ModelExchange"): (
        *_OF_FMI_3, "needsCompletedIntegratorStep", "providesEvaluateDiscreteStates",
    ),
    ("3", "ScheduledExecution"): _OF_FMI_3,
}  # fmt: skip
"""The capabilities that the standard names, by version and kind of FMU."""

RUN = ("CoSimulation", "ModelExchange")
"""The kinds that the master runs, the one it prefers first."""

CLOCKS = ("constant", "fixed", "calculated", "tunable", "changing", "countdown")
"""The variabilities of the interval of a clock that ticks by time."""

TIME_BASED = choices(CLOCKS, len(CLOCKS))

_PROCESSORS = {3: "x86", 40: "ARM", 62: "x86-64", 183: "AArch64", 243: "RISC-V"}
"""By their number in ELF."""

_LICENCE = re.compile(r"licen[cs]|dongle|flexlm|activation|not activated", re.IGNORECASE)

_SYMBOL = re.compile(r"undefined symbol:? \S+", re.IGNORECASE)
"""A function that the binary lacks: whatever it is called, it says nothing of a licence."""


class Obstacle(NamedTuple):
    """The reason why an FMU does not run here, and what would."""

    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.what}; {self.remedy}"


def kinds_of(root: Element, major: str) -> dict[str, Element]:
    """The kinds of an FMU, each with the element that has its capabilities."""
    if major == "1":
        implementation = root.find("Implementation")
        if implementation is None:
            return {"ModelExchange": Element("Capabilities")}
        capable = implementation.find(".//Capabilities")
        return {"CoSimulation": implementation if capable is None else capable}
    found = {kind: root.find(kind) for kind in KINDS}
    return {kind: element for kind, element in found.items() if element is not None}


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
            value = _default(flag) if text is None else typed(NUMBERS.get(flag, "Boolean"), text)
            capabilities[flag if kind == first else f"{flag} ({KINDS[kind]})"] = value
    return capabilities


def _default(flag: str) -> Value | None:
    """The value of a capability that is not declared; None for a step that is not fixed."""
    if flag not in NUMBERS:
        return False
    return 0 if NUMBERS[flag] == "Integer" else None


def this_machine(version: str) -> str:
    """The folder for binaries of this machine in an FMU of that version of FMI."""
    if not version.startswith("3"):
        return f"{'win' if sys.platform == 'win32' else sys.platform}{sys.maxsize.bit_length() + 1}"
    processor = platform.machine().lower()
    processor = {"amd64": "x86_64", "arm64": "aarch64"}.get(processor, processor)
    return f"{processor}-{platform.system().lower()}"


def processor(head: bytes) -> str:
    """The processor that an ELF file is for, by its first bytes; "" of another kind of file."""
    if head[:4] != b"\x7fELF" or len(head) < ELF_HEAD_BYTES:
        return ""
    number = int.from_bytes(head[18:20], "little")
    return _PROCESSORS.get(number, f"ELF machine {number}")


def platform_of(folder: str, head: bytes) -> str:
    """The platform of a binary in a folder of an FMU, as others than x86-64 are told apart.

    FMI 2.0 has one folder for all processors of 64 bit.
    """
    its = processor(head) if folder == "linux64" else ""
    return f"{folder} ({its})" if its not in ("", "x86-64") else folder


@cache
def this_platform(version: str) -> str:
    """That of this Python."""
    with Path(sys.executable).open("rb") as python:
        return platform_of(this_machine(version), python.read(ELF_HEAD_BYTES))


def of_kind(fmu: Interface) -> Obstacle | None:
    """The obstacle that no machine removes: a version of FMI, a kind or a clock not supported."""
    wanted = " or ".join(KINDS[kind] for kind in RUN)
    wanted = f"ask the vendor for an export as FMI 2.0 or 3.0, for {wanted}"
    kinds = " and ".join(KINDS[kind] for kind in fmu.kinds)
    if fmu.version == "1.0":
        return Obstacle(f"is FMI 1.0, for {kinds}", wanted)
    if not set(RUN) & set(fmu.kinds):
        return Obstacle(f"is for {kinds} only" if kinds else "declares no kind of FMU", wanted)
    return of_clocks(fmu)


def of_clocks(fmu: Interface) -> Obstacle | None:
    """The obstacle that is an input clock which the master cannot tick."""
    for v in fmu.input_clocks:
        variability = v.clock.variability if v.clock else ""
        what = f"has the input clock {v.name!r}"
        if v.shape:
            return Obstacle(f"{what}, an array", "must have scalar clocks")
        if variability == "triggered":
            return Obstacle(
                f"{what}, which another FMU has to tick (intervalVariability = 'triggered')",
                f"must have clocks that tick by time, as clocks are not connected: {TIME_BASED}",
            )
        if variability not in CLOCKS:
            return Obstacle(
                f"{what} with intervalVariability = {variability!r}", f"must be {TIME_BASED}"
            )
        if variability in ("constant", "fixed") and v.clock and v.clock.interval is None:
            return Obstacle(
                f"{what}, {variability}, without an interval",
                "must declare intervalDecimal, or intervalCounter and resolution",
            )
        if "ModelExchange" not in fmu.kinds and fmu.capability("hasEventMode") is not True:
            return Obstacle(f"{what}, which ticks in event mode", "must declare hasEventMode")
    return None


def of_binary(fmu: Interface) -> Obstacle | None:
    """The obstacle on this machine: the FMU has no binary for it."""
    here = this_platform(fmu.version)
    if here in fmu.platforms:
        return None
    what = f"has a binary for {choices(fmu.platforms)} only"
    if not fmu.platforms:
        what = "is source-only, C without a binary" if fmu.sources else "has no binary at all"
    remedy = f"ask the vendor for an FMU with a binary for {here}"
    if fmu.python and fmu.ours:
        remedy += ", or make a native one of its block: grasp-cosim build --native"
    if fmu.sources:
        from .source_code import why_not_compiled  # only here: most FMUs have a binary

        lacking = why_not_compiled(fmu)
        way = f"; its sources do not compile as they are: {lacking}"
        if not lacking:
            way = ", or compile its sources: LDFLAGS=-Wl,--no-as-needed,-lm fmpy compile FMU"
        remedy += way
    return Obstacle(f"{what}; this machine: {here}", remedy)


def of_loading(fmu: Interface, said: str) -> Obstacle | None:
    """The likely obstacle where the FMU does not instantiate and says something or nothing."""
    tool = fmu.tool or "the tool that made it"
    if _LICENCE.search(_SYMBOL.sub("", said)):
        return Obstacle(
            "needs a licence on this machine",
            f"have that of {tool} found here, or ask the vendor for an export that needs none",
        )
    if fmu.capability("needsExecutionTool") is True and not fmu.python:  # which always says so
        return Obstacle(
            f"is a link to {tool} and needs it here (needsExecutionTool)",
            "install that and its licence, or ask the vendor for an export that runs by itself",
        )
    if "failed to map segment" in said:
        return Obstacle(
            f"was extracted to {gettempdir()}, on a file system without execution (noexec)",
            "set TMPDIR to a folder on another one",
        )
    return None
