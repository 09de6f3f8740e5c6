"""The system description: components, wires and the experiment, from one TOML file.

    wires = ["plant.gap[1] -> sensor_1.gap", ...]   # before the first table, as TOML wants it

    [experiment]
    step = 1e-4                     # s, communication step
    stop = 3.0                      # s
    scheme = "sequential"           # or "jacobi"

    [components.plant]              # the order of the components is the order of execution
    fmu = "GripperPlant.fmu"        # relative to the TOML file
    values = { object_width = 0.07 }

Every input has exactly one source: a wire or a value.
"""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

from ..errors import InputError, choices
from .interface import Interface, Value, read_interface

Scheme = Literal["sequential", "jacobi"]
SCHEMES: tuple[str, ...] = get_args(Scheme)
NANOSECONDS = 1_000_000_000
LONGEST = 1e9
"""s; a time in nanoseconds then fits into 64 bits."""


@dataclass(frozen=True, slots=True)
class Component:
    """An instance of an FMU and the values that differ from the FMU's own start values."""

    name: str
    fmu: Path
    values: Mapping[str, Value]

    @property
    def interface(self) -> Interface:
        """What the FMU declares."""
        return read_interface(self.fmu)


@dataclass(frozen=True, slots=True)
class Port:
    """A variable of a component."""

    component: str
    variable: str

    def __str__(self) -> str:
        return f"{self.component}.{self.variable}"


@dataclass(frozen=True, slots=True)
class Wire:
    """From an output to an input of the same type."""

    source: Port
    target: Port


@dataclass(frozen=True, slots=True)
class System:
    """A checked system: every name exists, every input has one source or keeps a value.

    step_ns and stop_ns are in nanoseconds; stop_ns is a whole multiple of step_ns.
    """

    name: str
    components: tuple[Component, ...]
    wires: tuple[Wire, ...]
    step_ns: int
    stop_ns: int
    scheme: Scheme

    def __post_init__(self) -> None:
        _check_grid(self.step_ns, self.stop_ns)
        for component in self.components:
            for name, value in component.values.items():
                component.interface.parse(f"{self.name}: {component.name}.{name}", name, value)
        _check_wires(self)

    @classmethod
    def load(cls, path: str | Path, fmus: str | Path | None = None) -> "System":
        """The system of a TOML file; fmus is where its FMUs are, by default beside the file."""
        path = Path(path)
        try:
            table = tomllib.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise InputError(f"{path}: no such system file") from None
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise InputError(f"{path}: not readable as TOML: {error}") from error
        return _from_table(path.name, table, Path(fmus) if fmus else path.parent)

    def component(self, name: str, place: str) -> Component:
        """The component of that name; place says who asks, for the error message."""
        for component in self.components:
            if component.name == name:
                return component
        raise InputError(
            f"{place}: no component {name!r}; valid: {choices(c.name for c in self.components)}"
        )

    def start(self, key: str) -> float:
        """The number that 'component.variable' starts with: given in the system, or by its FMU."""
        name, _, variable = key.partition(".")
        component = self.component(name, key)
        declared = component.interface.by_name.get(variable)
        if declared is None or declared.start is None:
            raise InputError(f"{key}: {component.fmu.name} declares no such start value")
        return float(component.values.get(variable, declared.start))

    def with_values(self, values: Mapping[str, Value]) -> "System":
        """A copy with start values changed; the keys are like 'plant.object_width'."""
        return self.revised({}, values, ("swap", "with_values"))

    def swap(self, component: str, fmu: str | Path) -> "System":
        """A copy with the FMU of one component replaced by another with the same variables."""
        return self.revised({component: fmu}, {}, ("swap", "with_values"))

    def revised(
        self,
        fmus: Mapping[str, str | Path],
        values: Mapping[str, Value],
        places: tuple[str, str],
    ) -> "System":
        """A copy with FMUs replaced, then values changed; places name the two, for messages."""
        components = {c.name: c for c in self.components}
        for name, fmu in fmus.items():
            components[name] = replace(self.component(name, f"{places[0]} {name}"), fmu=Path(fmu))
        for key, value in values.items():
            name, _, variable = key.partition(".")
            place = f"{places[1]} {key}"
            self.component(name, place)
            component = components[name]
            parsed = component.interface.parse(place, variable, value, text=True)
            components[name] = replace(component, values={**component.values, variable: parsed})
        return replace(self, components=tuple(components.values()))

    def with_experiment(
        self,
        step: float | None = None,
        stop: float | None = None,
        scheme: str | None = None,
    ) -> "System":
        """A copy with another communication step or stop time in seconds, or another scheme."""
        return replace(
            self,
            step_ns=self.step_ns if step is None else _nanoseconds("step", step),
            stop_ns=self.stop_ns if stop is None else _nanoseconds("stop", stop),
            scheme=self.scheme if scheme is None else _scheme("scheme", scheme),
        )


def _from_table(place: str, table: dict[str, Any], folder: Path) -> System:
    _check_keys(place, table, {"experiment", "components", "wires"})
    experiment = _table(f"{place}: [experiment]", table.get("experiment"))
    _check_keys(f"{place}: [experiment]", experiment, {"step", "stop", "scheme"})
    components = _table(f"{place}: [components]", table.get("components"))
    wires = table.get("wires", [])
    if not isinstance(wires, list):
        raise InputError(f"{place}: wires = {wires!r}: must be a list of 'output -> input'")
    return System(
        place,
        tuple(_component(place, name, entry, folder) for name, entry in components.items()),
        tuple(_wire(f"{place}: wires[{i}]", text) for i, text in enumerate(wires)),
        _nanoseconds(f"{place}: experiment.step", experiment.get("step")),
        _nanoseconds(f"{place}: experiment.stop", experiment.get("stop")),
        _scheme(f"{place}: experiment.scheme", experiment.get("scheme", "sequential")),
    )


def _component(place: str, name: str, entry: Any, folder: Path) -> Component:
    place = f"{place}: [components.{name}]"
    entry = _table(place, entry)
    _check_keys(place, entry, {"fmu", "values"})
    fmu = entry.get("fmu")
    if not isinstance(fmu, str):
        raise InputError(f"{place}: fmu = {fmu!r}: must be the path of an FMU, as a string")
    values = _table(f"{place}: values", entry.get("values", {}))
    for key, value in values.items():
        if not isinstance(value, float | int | bool | str):
            raise InputError(
                f"{place}: values.{key} = {value!r}: must be a number, boolean or string"
            )
    component = Component(name, folder / fmu, {})
    parsed = {k: component.interface.parse(f"{place}: values", k, v) for k, v in values.items()}
    return replace(component, values=parsed)


def _wire(place: str, text: Any) -> Wire:
    parts = [part.strip() for part in text.split("->")] if isinstance(text, str) else []
    ports = [Port(*part.split(".", 1)) for part in parts if "." in part]
    if len(parts) != 2 or len(ports) != 2:
        raise InputError(f"{place}: {text!r}: must be 'component.output -> component.input'")
    return Wire(*ports)


def _check_wires(system: System) -> None:
    sources: dict[Port, Wire] = {}
    for i, wire in enumerate(system.wires):
        place = f"{system.name}: wires[{i}] '{wire.source} -> {wire.target}'"
        kinds = []
        for port, causality in ((wire.source, "output"), (wire.target, "input")):
            interface = system.component(port.component, place).interface
            valid = [v.name for v in interface.of(causality)]
            if port.variable not in valid:
                raise InputError(
                    f"{place}: {port.component} has no {causality} {port.variable!r}; "
                    f"valid: {choices(valid)}"
                )
            kinds.append(interface.by_name[port.variable].kind)
        if kinds[0] != kinds[1] or kinds[0] == "String":
            raise InputError(
                f"{place}: {wire.source} is {kinds[0]} and {wire.target} is {kinds[1]}; "
                "must be both Real, both Integer or both Boolean"
            )
        if wire.target.variable in system.component(wire.target.component, place).values:
            raise InputError(
                f"{place}: {wire.target} has two sources, the wire and a value; must have one"
            )
        if wire.target in sources:
            raise InputError(
                f"{place}: {wire.target} has two sources, {sources[wire.target].source} and "
                f"{wire.source}; must have one"
            )
        sources[wire.target] = wire
    outputs = [
        str(Port(c.name, v.name)) for c in system.components for v in c.interface.of("output")
    ]
    for component in system.components:
        for variable in component.interface.of("input"):
            port = Port(component.name, variable.name)
            if port not in sources and variable.name not in component.values:
                raise InputError(
                    f"{system.name}: input {port} has no source; wire one of {choices(outputs)} "
                    f"to it, or give it a value: --set {port}=VALUE, or in the system file"
                )


def _check_grid(step_ns: int, stop_ns: int) -> None:
    if stop_ns % step_ns:
        count = max(1, round(stop_ns / step_ns))
        raise InputError(
            f"step = {step_ns / NANOSECONDS:.9g} s does not divide stop = "
            f"{stop_ns / NANOSECONDS:.9g} s; stop could be {count * step_ns / NANOSECONDS:.9g} s"
        )


def _nanoseconds(place: str, seconds: Any) -> int:
    if isinstance(seconds, bool) or not isinstance(seconds, float | int):
        raise InputError(f"{place} = {seconds!r} s: must be a number")
    if not 0.0 < seconds <= LONGEST:
        raise InputError(
            f"{place} = {seconds!r} s: must be a number greater than 0, at most {LONGEST:g}"
        )
    nanoseconds = round(seconds * NANOSECONDS)
    if not nanoseconds or abs(nanoseconds / NANOSECONDS - seconds) > 1e-12 * seconds:
        raise InputError(f"{place} = {seconds!r} s: must be a whole number of nanoseconds")
    return nanoseconds


def _scheme(place: str, scheme: Any) -> Scheme:
    if scheme not in SCHEMES:
        raise InputError(f"{place} = {scheme!r}: must be one of {choices(SCHEMES)}")
    return scheme  # type: ignore[no-any-return]


def _table(place: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{place}: missing; must be a table")
    return value


def _check_keys(place: str, table: Mapping[str, Any], valid: Iterable[str]) -> None:
    for key in table:
        if key not in valid:
            raise InputError(f"{place}: unknown entry {key!r}; valid: {choices(sorted(valid))}")
