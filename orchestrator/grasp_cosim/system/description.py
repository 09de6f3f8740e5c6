"""The system description: components, connections and the experiment, checked once."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .. import extensions
from ..checks import choice, is_number, number
from ..errors import InputError, nearest
from ..files import check_nature
from ..interface.interface import Given
from .arrays import as_written, by_element, check_arrays
from .checks import (
    check_components,
    check_connections,
    check_initialisation,
    check_items,
    check_solvers,
    check_steps,
)
from .made_of import made_of
from .parts import LONGEST, NANOSECONDS, Isolation
from .scenario_checks import check_scenario
from .stimuli import Stimuli, read_stimuli
from .stimuli_checks import check_stimuli
from .structure import DIVERGING, SCHEMES, Diverging, Scheme, Structure
from .swap import Replacement, with_fmu
from .values import with_given


@dataclass(frozen=True, slots=True)
class System(Structure):
    """A checked system: every name exists, every input has one source or keeps a value."""

    def __post_init__(self) -> None:
        check_steps(self)
        object.__setattr__(self, "connections", by_element(self))
        for component in self.components:
            interface = component.interface
            for name, value in component.values.items():
                interface.parse(f"{self.name}: {component.name}.{name}", name, value)
        check_components(self)
        check_solvers(self)
        check_arrays(self)
        check_stimuli(self)
        check_connections(self)
        check_scenario(self)
        check_initialisation(self)
        for role, name in self.roles.items():
            self.component(name, f"{self.name}: [roles]: {role} = {name!r}")
        if not self.as_read:  # copies keep it
            object.__setattr__(self, "as_read", made_of(self))

    @classmethod
    def load(
        cls,
        path: str | Path,
        fmus: str | Path | None = None,
        *,
        step: float | None = None,
        stop: float | None = None,
        input: str | Path | Stimuli | None = None,  # noqa: A002 - as in the file and on the command line
    ) -> "System":
        """The system of a TOML file or SSP archive.

        step and stop in s, and a CSV file of inputs, go before what it says.

        fmus is where the FMUs of a TOML file are, by default beside it; an archive has its own.
        """
        path = Path(path)
        check_nature(path, "system")
        reader = extensions.readers.get(path.suffix.lower(), extensions.readers[".toml"])
        stimuli = _stimuli(input)
        system: System = reader(path, Path(fmus) if fmus else None, step, stop, stimuli)
        return system

    def start(self, key: str) -> float:
        """The number that 'component.variable' starts with, in the unit that it has in the system.

        Given there, or by its FMU.
        """
        name, _, variable = key.partition(".")
        component = self.component(name, key)
        declared = component.interface.by_name.get(variable)
        value = component.values.get(variable, None if declared is None else declared.start)
        if value is None:
            raise InputError(f"{key}: {component.fmu.name} declares no such start value")
        return float(value)

    def with_values(self, values: Mapping[str, Given]) -> "System":
        """A copy with start values changed; the keys are like 'plant.object_width'.

        Of a whole array the value is a list of lists, a NumPy array, or one for all elements.
        """
        return self.revised({}, values, ("swap", "with_values"))

    def swap(
        self,
        component: str,
        fmu: str | Path,
        *,
        rename: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
    ) -> "System":
        """A copy with the FMU of one component replaced by another with the same variables.

        Its values are converted where that has them in other units, and left out, with a note,
        where it has no such variable. rename and units are those of a Component, and go before its
        own.
        """
        new = Replacement(Path(fmu), rename or {}, units or {})
        return self.revised({component: new}, {}, ("swap", "with_values"))

    def revised(
        self,
        fmus: Mapping[str, str | Path | Replacement],
        values: Mapping[str, Given],
        places: tuple[str, str],
    ) -> "System":
        """A copy with FMUs replaced, then values changed; places name the two, for messages.

        An FMU given by its path alone must have what the component has values for.
        """
        components, notes = {c.name: c for c in self.components}, [*self.notes]
        given: dict[str, dict[str, Given]] = {}
        for key, value in values.items():
            name, dot, variable = key.partition(".")
            if not dot:
                ports = [f"{c.name}.{v}" for c in self.components for v in c.interface.by_name]
                raise InputError(
                    f"{places[1]} {key}: must be COMPONENT.VARIABLE; {nearest(key, ports)}"
                )
            self.component(name, f"{places[1]} {key}")
            given.setdefault(name, {})[variable] = value
        for name, fmu in fmus.items():
            place = f"{places[0]} {name}"
            new = fmu if isinstance(fmu, Replacement) else Replacement(Path(fmu), exact=True)
            was, anew = self.component(name, place), given.get(name, {})
            arrays = was.interface.arrays
            parts = (arrays[key].names if key in arrays else (key,) for key in anew)
            fresh = {variable for part in parts for variable in part}
            components[name], more = with_fmu(self, was, new, fresh, place)
            notes += more
            kept = [v for v in components[name].values if v not in fresh]
            check_items(was, components[name], kept, place)
        for name, more_values in given.items():
            place = f"{places[1]} {name}."
            components[name] = with_given(components[name], place.__add__, more_values, text=True)
        return replace(
            self,
            components=tuple(components.values()),
            connections=as_written(self),
            notes=tuple(notes),
        )

    def with_presets(self, *names: str) -> "System":
        """A copy with the values of presets, a later one before an earlier one."""
        system = self
        for name in names:
            if name not in self.presets:
                raise InputError(
                    f"{self.name}: no preset {name!r}; {nearest(name, self.presets)}; a system "
                    "file has them as [presets.NAME]"
                )
            place = f"{self.name}: [presets.{name}]"
            system = system.revised({}, self.presets[name], (place, place))
        return system

    def with_isolation(self, isolation: Isolation, component: str = "") -> "System":
        """A copy with all components, or one, in processes of their own or in this one."""
        components = tuple(
            replace(c, isolation=isolation) if component in ("", c.name) else c
            for c in self.components
        )
        return replace(self, components=components)

    def with_input(self, input: str | Path | Stimuli | None) -> "System":  # noqa: A002
        """A copy whose inputs without a connection or value are driven by a CSV file, or by none.

        Held instead of linear: `read_stimuli(path, "held")`.
        """
        return replace(self, input=_stimuli(input))

    def with_natives(self, natives: Mapping[str, Path]) -> "System":
        """A copy in which components of these names run native twins of their FMUs."""
        components = tuple(
            replace(c, native=natives.get(c.name, c.native)) for c in self.components
        )
        return replace(self, components=components)

    def with_experiment(
        self,
        step: float | None = None,
        stop: float | None = None,
        scheme: str | None = None,
        diverging: str | None = None,
    ) -> "System":
        """A copy with another communication step or stop time in seconds, or another scheme.

        Or that does something else where a signal runs away.
        """
        return replace(
            self,
            step_ns=self.step_ns if step is None else in_nanoseconds("step", step),
            stop_ns=self.stop_ns if stop is None else in_nanoseconds("stop", stop),
            scheme=self.scheme if scheme is None else as_scheme("scheme", scheme),
            diverging=self.diverging if diverging is None else as_diverging("diverging", diverging),
        )


def _stimuli(given: str | Path | Stimuli | None) -> Stimuli | None:
    return read_stimuli(given) if isinstance(given, str | Path) else given


def in_nanoseconds(place: str, seconds: Any, zero: bool = False) -> int:
    """A time in s as a whole number of nanoseconds; InputError where it is none.

    With zero, it may be 0.
    """
    if not is_number(seconds):
        raise InputError(f"{place} = {seconds!r} s: must be a number")
    span = f"from 0 to {LONGEST:g}" if zero else f"greater than 0, at most {LONGEST:g}"
    must = f"a number {span}"
    time = number(place, seconds, 0.0, LONGEST, above=not zero, must=must, unit="s")
    nanoseconds = round(time * NANOSECONDS)
    if abs(nanoseconds / NANOSECONDS - time) > 1e-12 * time:
        raise InputError(f"{place} = {seconds!r} s: must be a whole number of nanoseconds")
    return nanoseconds


def as_scheme(place: str, name: Any) -> Scheme:
    """The scheme of that name; InputError where there is none."""
    return choice(place, name, SCHEMES)  # type: ignore[no-any-return]


def as_diverging(place: str, name: Any) -> Diverging:
    """What a run does where a signal runs away; InputError where there is no such thing."""
    return choice(place, name, DIVERGING)  # type: ignore[no-any-return]
