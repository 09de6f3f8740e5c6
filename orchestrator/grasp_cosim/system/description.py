"""The system description: components, connections and the experiment, checked once."""

from __future__ import annotations

import logging
import operator
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, overload

from ..base.errors import InputError, nearest
from ..base.files import check_nature
from ..base.registry import check_registered, registered
from ..interface.values import Given, parse_value
from .changes import with_own_values
from .connectors import behind_connectors, check_connectors, driven_by_connectors
from .entries import sections, with_overrides, with_trigger
from .from_python import Part, from_sections
from .names import in_main_names
from .overrides import PLACE, RECORD, SECTIONS, Override, Overrides, as_overrides, grouped
from .parameters import Parameters, parameters_of
from .parts import Component, Connection
from .record import Record
from .replay import replayed
from .scenario import check_scenario
from .settings import summary
from .stimuli import Stimuli, read_stimuli
from .structure import Structure
from .times import TimeInput
from .toml import read_toml
from .validity import (
    as_written,
    by_element,
    check_arrays,
    check_components,
    check_connections,
    check_steps,
    check_stimuli,
)
from .without import without

LOGGER = logging.getLogger(__name__)
"""Gets what a system does without."""

ARCHIVE, OF_RUN = ".ssp", ".json"

FILES = (".toml", ARCHIVE)
"""The suffixes of files that have a system."""


@dataclass(frozen=True, init=False, repr=False)
class System(Structure):
    """A checked system: every name exists, every input has one source or keeps a value.

    It is made by System(...) in Python, by System.load() of a file, or by grasp_system(),
    hand_system(), tandem_system() and delicate_system(). It does not change: methods such as
    `with_values()` return a copy.

    Example:
        >>> from grasp_cosim import System
        >>> class Ramp:
        ...     outputs = {"y": (0.0, "m")}
        ...     def step(self, t, inputs):
        ...         return {"y": 2.0 * t}
        >>> class Follower:
        ...     inputs = {"u": (0.0, "m")}
        ...     def step(self, t, inputs):
        ...         return {"copy": inputs["u"]}
        >>> system = System(
        ...     components={"ramp": Ramp, "follower": Follower},
        ...     connections=["ramp.y -> follower.u"],
        ...     experiment={"step": 0.1, "stop": 1.0},
        ... )
        >>> sorted(system.by_name)
        ['follower', 'ramp']
    """

    @overload
    def __init__(
        self,
        name: str = ...,
        *,
        components: Mapping[str, Part],
        connections: Iterable[str | tuple[str, str] | Mapping[str, Any] | Connection] = ...,
        experiment: Mapping[str, Any],
        **sections: Any,
    ) -> None: ...
    @overload
    def __init__(
        self,
        name: str,
        components: tuple[Component, ...],
        connections: tuple[Connection, ...],
        *positional: Any,
        **attributes: Any,
    ) -> None: ...
    def __init__(
        self,
        name: str = "system",
        components: Any = (),
        connections: Any = (),
        *positional: Any,
        **attributes: Any,
    ) -> None:
        """Make a system of components, connections and an experiment.

            System(
                components={"plant": "Plant.fmu", "controller": PI},
                connections=["plant.gap -> controller.gap", "controller.force -> plant.force"],
                experiment={"step": 1e-3, "stop": 2.0},
            )

        Args:
            name: The name of the system.
            components: What each component is, by its name; they step in this order. It is the path
                of an FMU, the file of our block, NAME.py, which is built, a Component, or for
                trials Python code: a function (t, inputs), or a class with step(t, inputs), see
                system.python_code. Or it is a mapping with that as "fmu" and the other entries of a
                component in a file, such as "values" and "step".
            connections: Each a text "a.y -> b.u", a pair ("a.y", "b.u"), or a mapping as in a file.
            *positional: Further attributes of a Structure, which readers of files give.
            **attributes: `experiment`, with "step" and "stop" in s, which is required, and what
                else a system file has, as arguments of the same names: roles, metrics, events, ...
                Readers of files give the attributes of a Structure here.

        Raises:
            InputError: Something in it is wrong: a name that does not exist, an input with two
                sources, a value that does not fit.
        """
        if not positional and "step_ns" not in attributes:
            attributes = from_sections(name, components, connections, attributes)
            super().__init__(**attributes)
        else:
            super().__init__(name, components, connections, *positional, **attributes)
        self._check()

    def _check(self) -> None:
        """Complete it, and check all that it has."""
        check_steps(self)
        if self.input and self.input.recorded is not None:
            stimuli, note = replayed(self, self.input)
            object.__setattr__(self, "input", stimuli)
            notes = [n for n in self.notes if not n.startswith(f"{stimuli.file}: a recorded")]
            object.__setattr__(self, "notes", (*notes, note))
        elif self.input:
            object.__setattr__(self, "input", driven_by_connectors(self, self.input))
        for name, part in in_main_names(self).items():
            object.__setattr__(self, name, part)
        connections = by_element(self.name, self.components, self.connections)
        object.__setattr__(self, "connections", connections)
        for component in self.components:
            place = f"{self.name}: {component.name}"
            for name, value in component.values.items():
                parse_value(component.interface, f"{place}.{name}", name, value)
            if component.name in SECTIONS:
                raise InputError(
                    f"{place}: is the name of a section of a system file; must have another name"
                )
        check_components(self)
        check_stimuli(self)
        check_connections(self)
        check_arrays(self)
        check_connectors(self)
        check_scenario(self)
        self.record.check(f"{self.name}: record.signals:", self.components, self.outputs)
        for role, name in self.roles.items():
            self.component(name, f"{self.name}: [roles]: {role} = {name!r}")
        for group in self.metrics:
            check_registered(f"{self.name}: metrics: no group", "groups", group)
        if not self.as_read:  # copies keep it
            object.__setattr__(self, "as_read", summary(self))

    @classmethod
    def load(
        cls,
        path: str | Path,
        fmus: str | Path | None = None,
        *,
        step: TimeInput | None = None,
        stop: TimeInput | None = None,
        start: TimeInput | None = None,
        input: str | Path | Stimuli | None = None,  # noqa: A002 - as in the file and on the command line
        variant: str | None = None,
    ) -> System:
        """Read the system of a TOML file, of an SSP archive, or of the run of a run.json.

        Args:
            path: The file, .toml or .ssp, or the run.json of a run.
            fmus: The folder of the FMUs of a TOML file, by default its own; an archive has its own
                FMUs.
            step: The communication step in s, in place of that of the file.
            stop: The stop time in s, in place of that of the file.
            start: The start time in s, in place of that of the file.
            input: A table of stimuli, CSV, Arrow or Parquet, in place of that of the file.
            variant: The name of the structure, of an archive that has several; by default
                SystemStructure.ssd.

        Returns:
            The system.

        Raises:
            InputError: The file cannot be read, or something in it is wrong.
        """
        if fmus is not None and Path(path).suffix.lower() in (ARCHIVE, OF_RUN):
            raise InputError(f"{path}: has its own FMUs; those in {fmus} cannot take their place")
        times = _of_experiment({"start": start, "step": step, "stop": stop})
        system = read_system(path, times, fmus, _stimuli(input), variant)
        return system.with_overrides(times)

    @property
    def parameters(self) -> Parameters:
        """The parameters that can be set: value, unit, range and description by name."""
        return parameters_of(self)

    def start(self, key: str) -> float:
        """The number that a variable starts with, set by the system or declared by its FMU.

        Args:
            key: A name like "plant.object_width".

        Returns:
            The value in the unit of the variable.

        Raises:
            InputError: There is no such component, or neither has such a start value.
        """
        name, _, variable = key.partition(".")
        component = self.component(name, key)
        declared = component.interface.by_name.get(variable)
        value = component.values.get(variable, None if declared is None else declared.start)
        if value is None:
            raise InputError(f"{key}: {component.fmu.name} declares no such start value")
        return float(value)

    def with_values(self, values: Mapping[str, Given]) -> System:
        """A copy with other start values.

        Args:
            values: Values by names like "plant.object_width"; of an array a list. A number is in
                the unit of its variable; one with a unit is Quantity("50 mm"), (50, "mm") or the
                text "50 mm".

        Returns:
            The changed system.

        Raises:
            InputError: There is no such variable, or a value does not fit it.
        """
        return self.with_overrides(as_overrides(values, "with_values {place}"))

    def swap(
        self,
        component: str,
        fmu: str | Path,
        *,
        rename: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        values: Mapping[str, Given] | None = None,
        own_values: bool = False,
    ) -> System:
        """A copy in which another FMU takes the place of that of a component.

        The new FMU has the same variables. The values that the component has stay: they are
        converted where the new FMU has them in other units, and left out, with a note, where it has
        no such variable; a note also says which of them the new FMU declares otherwise.

        Args:
            component: The name of the component.
            fmu: The path of the new FMU.
            rename: The names of variables in the new FMU by those that the system has for them.
            units: The units of variables of the new FMU, where it declares none or a wrong one.
            values: Start values for the new FMU, by its variables and in their units.
            own_values: True drops the values that the component has, for those of the FMU.

        Returns:
            The changed system.

        Raises:
            InputError: There is no such component, the FMU does not load, or it does not fit.
        """
        self.component(component, f"swap {component}")
        if own_values:
            swapped = self.with_own_values(component)
            return swapped.swap(component, fmu, rename=rename, units=units, values=values)
        place = f"components.{component}"
        overrides: dict[str, Any] = {f"{place}.fmu": fmu}
        tables = {"values": values, "rename": rename, "units": units}
        for table, entries in tables.items():
            for name, value in (entries or {}).items():
                overrides[f"{place}.{table}.{name}"] = value
        return self.with_overrides(as_overrides(overrides, f"swap {component}"))

    def without(self, component: str) -> System:
        """A copy without a component, whose place something outside takes: your code, or hardware.

        The inputs that it was connected to keep their start values until they are set. What the
        system says of it is left out, with a note on events, faults and limits.

        Args:
            component: The name of the component.

        Returns:
            The changed system.

        Raises:
            InputError: There is no such component, or no other one.

        Example:
            >>> from grasp_cosim import grasp_system, simulate
            >>> with simulate.session(grasp_system().without("controller"), step=1e-3) as session:
            ...     session.set("plant.force[1]", -0.1)
            ...     more = session.step(10)
            ...     session["plant.velocity[1]"] < 0.0
            True
        """
        return replace(self, **without(self, component))

    def with_own_values(self, *names: str) -> System:
        """A copy in which components have the start values that their FMUs declare.

        Values of inputs, and those that decide on the sizes of arrays, stay.

        Args:
            *names: The names of the components.

        Returns:
            The changed system.
        """
        components = tuple(
            with_own_values(c) if c.name in names and c.values else c for c in self.components
        )
        return replace(self, components=components, connections=as_written(self))

    def with_settings(self, settings: Mapping[str, Any]) -> System:
        """A copy with single values of its file changed, by their places in it.

        Args:
            settings: Values by places like "experiment.scheme", "components.plant.fmu" or
                "components.plant.rename.gap[1]"; "plant.object_width" is short for
                "components.plant.values.object_width". A text stands for a number or a boolean
                where there must be one. An FMU takes the place of another as by swap(), and values
                next to it are in its units.

        Returns:
            The changed system.

        Raises:
            InputError: There is no such place, one is set twice, or a value does not fit it.
        """
        return self.with_overrides(as_overrides(settings, "with_settings {place}"))

    def with_overrides(self, overrides: Iterable[Override]) -> System:
        """A copy as of with_settings(), for overrides that know where they come from.

        Args:
            overrides: What changes, by place; the origin of each is told where it does not fit.

        Returns:
            The changed system, or this one where nothing of it changes.

        Raises:
            InputError: There is no such place, one is set twice, or a value does not fit it.
        """
        overrides = [*overrides]
        if not overrides:
            return self
        groups = grouped(self, behind_connectors(self, overrides))
        components, notes = dict(self.by_name), [*self.notes]
        for name, changes in groups.components.items():
            components[name], remarks = with_overrides(components[name], changes, self)
            notes += remarks
        changed = tuple(components.values())
        if not groups.sections and _are_of_parameters(self, groups):
            return self._with_parameters(changed)
        attributes = sections(self, groups.sections)
        if not groups.components and all(getattr(self, n) == v for n, v in attributes.items()):
            return self  # as where the reader of an archive has taken the times
        record: Record = attributes.pop("record")
        record, missing = record.without_missing(self.components, changed, self.outputs)
        for text in missing:
            notes.append(f"record: {text!r} matches no signal any more: it is left out")
        return replace(
            self,
            components=changed,
            connections=as_written(self),
            notes=tuple(notes),
            record=record,
            **attributes,
        )

    def with_presets(self, *names: str) -> System:
        """A copy with the values of presets.

        Args:
            *names: The presets of the system; where two have the same place, the later one holds.

        Returns:
            The changed system.

        Raises:
            InputError: The system has no such preset.
        """
        system = self
        for name in names:
            if name not in self.presets:
                raise InputError(
                    f"{self.name}: no preset {name!r}; {nearest(name, self.presets)}; a system "
                    "file has them as [presets.NAME]"
                )
            origin = f"{self.name}: [presets.{name}] {PLACE}"
            system = system.with_overrides(as_overrides(self.presets[name], origin))
        return system

    def with_input(self, input: str | Path | Stimuli | None) -> System:  # noqa: A002
        """A copy whose tunable parameters and inputs without a source are driven by a table.

        Args:
            input: The path of a table of stimuli, CSV, Arrow or Parquet; None for no table.

        Returns:
            The changed system.

        Raises:
            InputError: The table cannot be read, or names what it cannot drive.
        """
        stimuli = _stimuli(input)
        return self if stimuli is self.input else replace(self, input=stimuli)

    def with_record(
        self,
        *signals: str,
        trigger: str | Literal[False] | None = None,
        before: TimeInput | None = None,
        after: TimeInput | None = None,
    ) -> System:
        """A copy that records other signals, or in windows around a trigger.

        Args:
            *signals: Names like "plant.gap[1]", or patterns like "plant.*"; one behind a ! is left
                out: with_record("!plant.clock"). Without any the outputs are recorded.
            trigger: A condition like "plant.contact[1] == true". A window of the recording begins
                where it becomes true. False takes the trigger away. None leaves it as it is.
            before: How much of what came before is in a window, in s. None leaves it as it is, 0 by
                default.
            after: How long a window goes on after the last point in it at which the condition
                became true, in s. None leaves it as it is; a new trigger must have it.

        Returns:
            The changed system.

        Raises:
            InputError: A name or pattern matches no signal, or the trigger is no condition.
        """
        for signal in signals:
            if not isinstance(signal, str):
                raise InputError(
                    f"record: {signal!r}: must be a name; several are several arguments"
                )
        record = replace(self.record, signals=signals)
        record.check("record:", self.components, self.outputs)
        entries = {"trigger": trigger, "before": before, "after": after}
        overrides = {
            entry: Override(f"{RECORD}.{entry}", value)
            for entry, value in entries.items()
            if value is not None
        }
        record = with_trigger(record, overrides)
        return replace(self, record=record)

    def untriggered(self) -> System:
        """The system that records the whole run; the logger says where it had a trigger.

        Returns:
            The changed system, or itself where it has no trigger.
        """
        if self.record.trigger is None:
            return self
        LOGGER.warning("%s: record.trigger: is left out, as all rows are needed", self.name)
        return replace(self, record=self.record.untriggered())

    def as_steered(self) -> System:
        """The system as a session has it, which by default records all that it may set.

        Returns:
            The changed system, or itself where that makes no difference.
        """
        steered = replace(self, steered=True)
        return self if steered.recorded == self.recorded else steered

    def natively(self, native: bool | None = None) -> System:
        """A copy that runs native twins of its FMUs: the same content in C, with the same bits.

        What is swapped in afterwards runs as it is.

        Args:
            native: None takes the twins that there are or that can be built here; other FMUs run as
                they are, which the logger says. So does a run for which nothing was chosen. True
                demands those of our blocks. False runs all FMUs as they are named.

        Returns:
            The changed system.

        Raises:
            InputError: With True twins cannot be built; with False an FMU in Python has no binary
                here.
        """
        return self.with_natives(registered("twins", "System")(self, native))

    def with_natives(self, natives: Mapping[str, Path | None]) -> System:
        """A copy in which components run native twins of their FMUs.

        Args:
            natives: The path of the twin by the name of its component; None for the FMU itself.

        Returns:
            The changed system, or itself where nothing changes.
        """
        components = tuple(_with_native(c, natives) for c in self.components)
        changed = any(map(operator.is_not, components, self.components))
        return replace(self, components=components) if changed else self

    def with_experiment(
        self,
        step: TimeInput | None = None,
        stop: TimeInput | None = None,
        scheme: str | None = None,
        diverging: str | None = None,
        start: TimeInput | None = None,
    ) -> System:
        """A copy with another experiment. What is None stays as it is.

        Args:
            step: The communication step in s. It may also be a text, a pair or a Quantity with its
                unit: "0.5 ms", (0.5, "ms").
            stop: The stop time in s.
            scheme: "sequential" or "jacobi".
            diverging: "stop" or "continue": what follows on a signal that runs away.
            start: The start time in s.

        Returns:
            The changed system.

        Raises:
            InputError: A value is none of these, or times do not fit each other.
        """
        entries = {"step": step, "stop": stop, "start": start}
        entries |= {"scheme": scheme, "diverging": diverging}
        return self.with_overrides(_of_experiment(entries))

    def _with_parameters(self, components: tuple[Component, ...]) -> System:
        """A copy with other values of parameters, which nothing goes by that is checked or shared.

        So a thousand runs do not check the rest as often, nor work out what follows from it.
        """
        self.observed, self._results  # noqa: B018 - there from now on, and shared
        copy = object.__new__(type(self))
        vars(copy).update(vars(self), components=components)
        vars(copy).pop("by_name", None)  # which has the components of self
        return copy


def _with_native(component: Component, natives: Mapping[str, Path | None]) -> Component:
    """The component with its twin, or None for the FMU itself; as it is where it is not named."""
    native = natives.get(component.name, component.native)
    as_named = component.as_named if component.name not in natives else native is None
    if (native, as_named) == (component.native, component.as_named):
        return component
    return replace(component, native=native, as_named=as_named)


def as_system(system: Any, who: str) -> System:
    """A System as it is, or that of the path of a system file; `who` begins the error."""
    if isinstance(system, str | Path):
        return System.load(system)
    if not isinstance(system, System):
        raise InputError(
            f"{who}: {type(system).__name__} {str(system)[:40]!r}: must be a System, as "
            "System.load(), grasp_system() or hand_system() give it, or the path of a system file"
        )
    return system


def is_archive(path: str | Path) -> bool:
    """True for an SSP archive, by the suffix of its name."""
    return Path(path).suffix.lower() == ARCHIVE


def read_system(
    path: str | Path,
    times: Iterable[Override] = (),
    fmus: str | Path | None = None,
    stimuli: Stimuli | None = None,
    variant: str | None = None,
) -> System:
    """The system as a TOML file, an SSP archive or a run.json has it, but for its stimuli.

    times override the start, step and stop that an archive of another tool has, which may leave
    them open; all else that is read gets them by with_overrides(). variant names the structure of
    an archive that has several.
    """
    path = Path(path)
    check_nature(path, "system")
    suffix = path.suffix.lower()
    if suffix not in (ARCHIVE, OF_RUN):
        if variant is not None:
            raise InputError(f"{path}: variant = {variant!r}: only an .ssp may have variants")
        return System(**read_toml(path, Path(fmus) if fmus else None, stimuli))
    system: System = registered("readers", suffix)(path, times, stimuli, variant)
    return system


def _of_experiment(entries: Mapping[str, Any]) -> list[Override]:
    """The overrides of entries of [experiment] by name, but for those that are None."""
    return [
        Override(f"experiment.{entry}", value, origin=entry)
        for entry, value in entries.items()
        if value is not None
    ]


def _are_of_parameters(system: System, overrides: Overrides) -> bool:
    """True if overrides of components are of parameters only, and none of these in an array."""
    for name, of_component in overrides.components.items():
        if of_component.entries or [*of_component.tables] != ["values"]:
            return False
        variables = system.component(name, name).interface.by_name
        for variable in map(variables.get, of_component.table("values")):
            if not variable or variable.causality != "parameter" or variable.element:
                return False
    return True


def _stimuli(stimuli: str | Path | Stimuli | None) -> Stimuli | None:
    """Stimuli as they are, or those of a table at a path."""
    return read_stimuli(stimuli) if isinstance(stimuli, str | Path) else stimuli
