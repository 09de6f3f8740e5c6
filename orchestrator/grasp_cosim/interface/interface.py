"""The interface that an FMU declares: its variables, units and capabilities."""

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from shlex import quote
from typing import Any

from ..base.errors import InputError, choices
from ..base.scratch import without_scratch
from ..base.si_units import Unit, known_unit
from .fmi_types import Value
from .units import IDENTITY, Conversion, conversion
from .variables import PARAMETERS, Array, Variable


@dataclass(frozen=True)
class ModelExchange:
    """Needs of model exchange: the name of the binary, in FMI 2.0 the numbers of states and event
    indicators, and whether it is told of completed steps. Of FMI 3.0 the instance says the numbers.
    """

    identifier: str
    states: int = 0
    indicators: int = 0
    wants_completed_steps: bool = True


@dataclass(frozen=True, repr=False)
class Interface:
    """The interface of an FMU; guid is the instantiation token, tool what it was made with.

    kinds are CoSimulation, ModelExchange, ScheduledExecution. capabilities are all of the first
    kind, then all of a later one as 'FLAG (model exchange)'; see obstacles.capabilities_of().
    experiment is the default one: start_time, stop_time, tolerance and step_size, as typed() gives
    them. log_categories are what its messages are sorted by. platforms are those it has a binary
    for, sources says that it has C. flaw is the first number that could not be read, for which no
    master takes the FMU. arrays are those that were taken apart, by name: see expansion.py.
    exchange is there where it is for model exchange, too.
    """

    path: Path
    guid: str
    identifier: str
    variables: tuple[Variable, ...]
    version: str = "2.0"
    units: Mapping[str, Unit] = field(default_factory=dict)
    kinds: tuple[str, ...] = ("CoSimulation",)
    capabilities: Mapping[str, Value | None] = field(default_factory=dict)
    experiment: Mapping[str, Value | None] = field(default_factory=dict)
    log_categories: tuple[str, ...] = ()
    platforms: tuple[str, ...] = ()
    sources: bool = False
    python: bool = False
    """True if it was made with pythonfmu: its binary calls Python, and keeps the GIL."""
    model_name: str | None = None
    tool: str | None = None
    flaw: str = ""
    ambiguous: tuple[str, ...] = ()
    """The names that several variables have, which are not among `variables`."""
    arrays: Mapping[str, Array] = field(default_factory=dict)
    exchange: ModelExchange | None = None
    user_path: Path | None = None
    """The path by which the user knows it, where that is not `path`."""

    @property
    def ours(self) -> bool:
        """True if it was made here."""
        return (self.tool or "").startswith("grasp-cosim")

    @property
    def called(self) -> str:
        """The FMU as messages name it."""
        return without_scratch(str(self.user_path or self.path))

    @property
    def file_name(self) -> str:
        """The name of its file as messages name it."""
        return (self.user_path or self.path).name

    @cached_property
    def _variants(self) -> dict[tuple[Any, ...], "Interface"]:
        return {}

    def variant(self, key: tuple[Any, ...], make: Callable[[], "Interface"]) -> "Interface":
        """What is made of this one by elements, names or units, once, as it is asked for again."""
        if key not in self._variants:
            self._variants[key] = make()
        return self._variants[key]

    @cached_property
    def sized_by(self) -> tuple[str, ...] | None:
        """The variables that hold lengths of arrays; None where there are no arrays."""
        if not any(v.shape for v in self.variables):
            return None
        return tuple(dict.fromkeys(name for v in self.variables for name in v.sizes if name))

    @cached_property
    def by_name(self) -> dict[str, Variable]:
        """The variables by their names."""
        return {v.name: v for v in self.variables}

    def sample(self, name: str) -> Variable | None:
        """The variable of a name; of an array its first element. None where there is none."""
        names = self.elements(name)
        return self.by_name.get(names[0]) if names else None

    def elements(self, name: str) -> tuple[str, ...]:
        """The names of the variables that a name stands for: of an array its elements.

        Scalars that an FMU names like these, Gaps[1] and Gaps[2], are Gaps. Any other name stands
        for itself.
        """
        if name in self.arrays:
            return self.arrays[name].names
        if name in self.by_name:
            return (name,)
        element = re.compile(rf"{re.escape(name)}\[\d+(,\d+)*\]")
        return tuple(filter(element.fullmatch, self.by_name)) or (name,)

    def capability(self, flag: str) -> Value | None:
        """The value of a capability, under the name that FMI 2.0 or 3.0 has for it."""
        common_name = _common_name(flag)
        for name, value in self.capabilities.items():
            if _common_name(name) == common_name:
                return value
        return None

    def __repr__(self) -> str:
        """What FMU it is of, and how many variables that has of which causality."""
        counts = Counter(variable.causality for variable in self.variables)
        variables = ", ".join(f"{count} {causality}" for causality, count in counts.items())
        return f"Interface of {self.path.name}, FMI {self.version}: {variables or 'no variables'}"

    @property
    def can_vary_step(self) -> bool:
        """True if the communication step may vary."""
        return self.capability("canHandleVariableCommunicationStepSize") is True

    @property
    def has_states(self) -> bool:
        """True if its state can be saved and restored."""
        return self.capability("canGetAndSetFMUstate") is True

    @cached_property
    def input_clocks(self) -> tuple[Variable, ...]:
        """The clocks that a master has to tick."""
        return tuple(v for v in self.of("input") if v.clock)

    @property
    def event_mode(self) -> bool:
        """True if its events are handled with the master, where it runs co-simulation.

        It then may end a step at one. An FMU that cannot vary its step handles events itself, but
        for those of clocks.
        """
        if not self.version.startswith("3") or self.capability("hasEventMode") is not True:
            return False
        return self.can_vary_step or bool(self.input_clocks)

    @property
    def step(self) -> float | None:
        """The communication step in s that its default experiment names."""
        step = self.experiment.get("step_size")
        return None if step is None else float(step)

    @property
    def tolerance(self) -> float | None:
        """The relative tolerance that its default experiment names."""
        tolerance = self.experiment.get("tolerance")
        return tolerance if isinstance(tolerance, float) and tolerance > 0.0 else None

    def unit(self, variable: Variable) -> Unit | None:
        """The unit that is declared for a variable, if it is defined, or known by its name."""
        name = variable.unit or ""
        return self.units.get(name) or known_unit(name)

    def of(self, *causalities: str) -> list[Variable]:
        """The variables of the given causalities, in the order of declaration.

        An input is there once, by its main name, as it has one source.
        """
        return [
            v
            for v in self.variables
            if v.causality in causalities and not (v.alias and v.causality == "input")
        ]

    @cached_property
    def main_names(self) -> Mapping[str, str]:
        """The main names of variables and arrays that can be set, by other names of them.

        FMI 3.0 declares such aliases; in FMI 2.0 variables of one value reference are the same one.
        Among them the input is the main one, or a parameter, or else what is declared first.
        """
        is_fmi_3 = self.version.startswith("3")
        main: dict[tuple[int, str, int], Variable] = {}
        names: dict[str, str] = {}
        settable = [v for v in self.variables if v.settable]
        settable.sort(key=lambda v: (v.causality != "input", v.causality not in PARAMETERS))
        for v in settable:
            place = v.element.place if v.element else 0
            first = main.setdefault((v.reference, "" if is_fmi_3 else v.kind, place), v)
            if first is v:
                continue
            names[v.name] = first.name
            if v.element and first.element:
                names[v.element.array] = first.element.array
        return names

    def main_name(self, name: str) -> str:
        """The main name of a variable or array."""
        return self.main_names.get(name, name)

    @property
    def inputs(self) -> list[Variable]:
        """The inputs, each by its main name only."""
        return [v for v in self.of("input") if self.main_name(v.name) == v.name]

    def by_main_names(
        self, values: Mapping[str, Value], place: Callable[[str], str]
    ) -> dict[str, Value]:
        """Values by main names; InputError where two names of one variable have two values.

        place says of a name where its value comes from.
        """
        name_of: dict[str, str] = {}
        for name, value in values.items():
            first = name_of.setdefault(self.main_name(name), name)
            if values[first] != value:
                raise InputError(
                    f"{place(name)} = {value!r}: is another name of {first}, which is "
                    f"{values[first]!r}; must have one value"
                )
        return {main: values[name] for main, name in name_of.items()}

    def conversion(self, name: str, target: "Interface") -> Conversion | None:
        """The conversion of a variable into the unit that `target` has it in; None for no way.

        A unit that is not declared is taken to be the same as the other.
        """
        source_variable, target_variable = self.by_name[name], target.by_name[name]
        names = (source_variable.unit, target_variable.unit)
        if None in names or names[0] == names[1]:
            return IDENTITY
        source_unit, target_unit = self.unit(source_variable), target.unit(target_variable)
        return conversion(source_unit, target_unit) if source_unit and target_unit else None

    @property
    def listing(self) -> str:
        """The command that shows all variables, for messages."""
        return f"`grasp-cosim inspect {quote(without_scratch(str(self.path)))}`"

    @property
    def short(self) -> str:
        """The FMU in a message on a name that it does not have."""
        if not self.ambiguous:
            return self.path.name
        return f"{self.file_name}, where several are called {choices(self.ambiguous)},"


def _common_name(flag: str) -> str:
    """A capability by a name that FMI 2 and 3 have in common."""
    return flag.lower().removesuffix("s")
