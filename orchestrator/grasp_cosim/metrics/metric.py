"""A metric: a function of recorded signals, with a name, a unit and a description.

The function gets a Signals: names begin with a role or a component, and values are in SI base
units. It returns a number, True or False, None where the moment never comes, or a list of these,
one per finger for instance. An example: docs/guide.md.
"""

from __future__ import annotations

import hashlib
import inspect
import pickle
import sys
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from math import isfinite
from pathlib import Path
from pkgutil import resolve_name
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.checks import known
from ..base.errors import InputError, choices, nearest
from ..base.errors import reason as reason_of
from ..base.higher import groups, higher
from ..base.si_units import refusal
from ..interface.units import Conversion

Value = float | bool | None
RESERVED = frozenset((
    "complete", "ended_at", "error", "index", "missing_metrics", "proxies",
    "real_time_factor", "realtime", "scheme", "step", "steps", "stop", "units", "verdict",
    "wall_time",
))  # fmt: skip
"""Names beside metrics in what `run --json` prints, and in the table of a sweep."""


ALL = "[*]"
"""Ends the name of an array of which a metric takes all elements."""


class MissingSignalError(KeyError):
    """A signal that a metric needs was not recorded; its text says which and why."""

    def __str__(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True, eq=False)
class Signals(Mapping[str, npt.NDArray[Any]]):
    """Recorded signals by names like plant.gap[1], where plant is a role or a component.

    `time` in s and every signal have the shape (rows,). They come in SI base units, by_name has
    them as recorded, and to_si how those are converted that are not in SI. `roles` maps a role to
    the component that plays it, if not the one of its name. `start_values` are those that the
    system sets, by names like plant.angle[1], in the units of their components.
    """

    time: npt.NDArray[np.float64]
    by_name: Mapping[str, npt.NDArray[Any]]
    roles: Mapping[str, str] = field(default_factory=dict)
    to_si: Mapping[str, Conversion] = field(default_factory=dict)
    start_values: Mapping[str, Any] = field(default_factory=dict)
    worked_out: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)
    """What one metric leaves for the next, by keys of their own; signals in SI units by name."""

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        """The signal; MissingSignalError where it was not recorded."""
        reason = lacking((name,), self.by_name, self.roles)
        own = resolved(name, self.roles)
        if reason:
            component = own.partition(".")[0]
            if any(signal.startswith(f"{component}.") for signal in self.by_name):
                reason += f"; what is no output must be recorded: --record {own}"
            raise MissingSignalError(reason)
        if own not in self.to_si:
            return self.by_name[own]
        if own not in self.worked_out:
            self.worked_out[own] = self.to_si[own](self.by_name[own])
        converted: npt.NDArray[Any] = self.worked_out[own]
        return converted

    def given(self, name: str, otherwise: float) -> float:
        """The number that a parameter was set to by the system, else the one given."""
        return float(self.start_values.get(resolved(name, self.roles), otherwise))

    def __iter__(self) -> Iterator[str]:
        return iter(self.by_name)

    def __len__(self) -> int:
        return len(self.by_name)


Function = Callable[[Signals], Value | Sequence[Value]]


@dataclass(frozen=True, slots=True, eq=False)
class Metric:
    """A function of recorded signals and how its value is named and shown.

    `unit` is that of the value ("1" for a share, None for true or false); in tables the value is
    shown times `factor` in `shown_unit`. `entries` name its values where it has several, like
    ("finger 1", "finger 2"). `needs` are the signals without which there is no value; a mapping
    gives the SI unit in which each is expected, or None, so that one of another quantity is refused
    before a run. plant.gap[*] stands for all elements of an array, and the entry "finger *" then
    for one each. Metrics of one `group` are there together or not at all, and why not is said once;
    an `optional` one is left out in silence. A `reason` says why others have no value: it is left
    out where it has none itself, and a qualification does not compare it. `none` says what having
    no value means: "nothing was touched".
    """

    name: str
    function: Function
    unit: str | None = None
    description: str = ""
    label: str = ""
    factor: float = 1.0
    shown_unit: str | None = None
    entries: tuple[str, ...] = ()
    needs: Collection[str] = ()
    group: str = ""
    optional: bool = False
    reason: bool = False
    none: str = ""
    origin: tuple[str, str] | None = None
    """Of a metric from a file, the file's name and text: so it travels to other processes."""

    @property
    def title(self) -> str:
        """The label, or the name in words."""
        return self.label or self.name.replace("_", " ")

    @property
    def display_unit(self) -> str:
        """The unit in which tables show it."""
        unit = self.unit if self.shown_unit is None else self.shown_unit
        return "" if unit in (None, "1") else str(unit)

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its single values: name, or name[1], name[2], ..."""
        if not self.entries:
            return (self.name,)
        return tuple(f"{self.name}[{i}]" for i in range(1, len(self.entries) + 1))

    @property
    def expects(self) -> Mapping[str, str | None]:
        """The units that it expects of signals, by name."""
        return self.needs if isinstance(self.needs, Mapping) else {}

    def column_title(self, column: str) -> str:
        """The title of one of its columns: "time to contact, finger 1"."""
        place = self.columns.index(column)
        return f"{self.title}, {self.entries[place]}" if self.entries else self.title

    def of(self, names: Collection[str], roles: Mapping[str, str]) -> Metric:
        """The metric of so many elements as there are of its arrays in signals of these `names`."""
        arrays = [need for need in self.needs if need.endswith(ALL)]
        if not arrays:
            return self
        element = arrays[0].replace("*", "{}").format
        missing = next(j for j in count(1) if resolved(element(j), roles) not in names)

        def each(text: str) -> list[str]:
            there = range(1, max(2, missing)) if "*" in text else (1,)
            return [text.replace("*", str(j)) for j in there]

        needs: Collection[str] = [name for need in self.needs for name in each(need)]
        if self.expects:
            needs = {name: unit for need, unit in self.expects.items() for name in each(need)}
        entries = tuple(entry for several in self.entries for entry in each(several))
        return replace(self, needs=needs, entries=entries)

    def __call__(self, signals: Signals) -> Value | Sequence[Value]:
        """Return what its function does, so that other functions can call it."""
        return self.function(signals)

    def __reduce__(self) -> tuple[Any, ...]:
        """To another process a metric goes by the text of its file, or by where it is found."""
        if self.origin is not None:
            return _from_text, (*self.origin, self.name)
        of_group = metrics_of([self.group]) if self.group in groups() else ()
        if any(self.function is m.function for m in of_group):
            return _of_group, (self.group, self.name, self.needs, self.entries)
        module, name = (getattr(self.function, key, "") for key in ("__module__", "__qualname__"))
        if getattr(sys.modules.get(module), name, None) is self:  # it replaced its function there
            return resolve_name, (f"{module}:{name}",)
        return Metric, tuple(getattr(self, field) for field in self.__dataclass_fields__)


def _of_group(group: str, name: str, needs: Any, entries: tuple[str, ...]) -> Metric:
    """The metric of that name of a group of ours, in another process."""
    found = next(m for m in metrics_of([group]) if m.name == name)
    return replace(found, needs=needs, entries=entries)


def metric(name: str, **more: Any) -> Callable[[Function], Metric]:
    """Make a Metric of the function below; `more` are the other fields of a Metric by keyword.

    Without a `description` it is the first line of the function's docstring. InputError where
    `name` is no identifier, so that it can be a column and a key, or RESERVED.
    """
    if not name.isidentifier():
        raise InputError(f"metric {name!r}: must be a name of letters, digits and _")
    if name in RESERVED:
        raise InputError(f"metric {name!r}: every run has this beside; must have another name")
    for unit in (more.get("unit"), more.get("shown_unit")):
        if unit and (reason := refusal(unit)):
            raise InputError(f"metric {name!r}: {reason}")

    def made(function: Function) -> Metric:
        first, *_ = (function.__doc__ or "").strip().splitlines() or [""]
        return Metric(name, function, **{"description": first, **more})

    return made


@dataclass(frozen=True, slots=True)
class Measured:
    """The values of metrics by name, those metrics, why others have none, and which failed."""

    values: Mapping[str, Any]
    metrics: tuple[Metric, ...]
    missing: tuple[str, ...]
    failures: tuple[str, ...] = ()

    def check(self) -> None:
        """InputError at the first function that failed."""
        if self.failures:
            raise InputError(self.failures[0])

    @property
    def units(self) -> dict[str, str | None]:
        """The units of the values, by name."""
        return {m.name: m.unit for m in self.metrics}

    def flat(self) -> dict[str, Value]:
        """Single values by column, name or name[1]; InputError where a function failed."""
        self.check()
        found: dict[str, Value] = {}
        for name, value in self.values.items():
            if isinstance(value, list):
                found.update({f"{name}[{i}]": v for i, v in enumerate(value, start=1)})
            else:
                found[name] = value
        return found


def metrics_of(names: Iterable[str], more: Iterable[Metric] = ()) -> tuple[Metric, ...]:
    """The metrics of groups, then `more`; InputError for no such group, or two of one name."""
    found: dict[str, Metric] = {}
    for group in names:
        known("metrics: no group", group, groups())
        found |= {m.name: m for m in higher(f"{group}.metrics").METRICS}
    for m in more:
        if m.name in found:
            raise InputError(f"metric {m.name!r}: is defined twice; must have another name")
        found[m.name] = m
    return tuple(found.values())


def check_groups(system: Any) -> list[str]:
    """What check() of a group's metrics.py notes of a System's values.

    InputError where it has something against them.
    """
    checks = (getattr(higher(f"{group}.metrics"), "check", None) for group in system.metrics)
    return [note for check in checks if check for note in check(system)]


def chosen(
    wanted: Iterable[Metric | Function | str],
    of_groups: Iterable[str],
    names: Collection[str],
    roles: Mapping[str, str],
) -> tuple[Metric, ...]:
    """Those of `wanted` that are not in groups anyway: metrics, functions, names of metrics.

    A function is a metric of its own name, without a unit; a name is one of those in the groups.
    InputError where there is none of that name, or the signals of these `names` do not permit it.
    """
    usual, own = {m.name: m for m in metrics_of(of_groups)}, []
    for item in wanted:
        if isinstance(item, Metric):
            own.append(item)
        elif callable(item):
            own.append(metric(str(getattr(item, "__name__", type(item).__name__)))(item))
        elif not isinstance(item, str):
            raise InputError(f"metrics: {item!r}: must be a metric, a function or a name")
        elif item not in usual:
            raise InputError(f"metrics: {item!r}: no such metric; {nearest(item, usual)}")
        elif reason := lacking(usual[item].needs, names, roles):
            raise InputError(f"metrics: {item}: is not available: {reason}")
    return tuple(own)


def check_portable(metrics: Iterable[Metric]) -> None:
    """InputError where a metric cannot go to other processes, as those of many runs have to."""
    for m in metrics:
        try:
            pickle.dumps(m)
        except Exception as error:  # pickle has one of its own for each reason
            raise InputError(
                f"metric {m.name!r}: cannot go to another process ({_said(error)}); must be a "
                "function under @metric(name) in a module or a file"
            ) from error


def _place(function: Function, error: Exception) -> str:
    """The file and line of a function that failed, to begin a message with."""
    if (code := getattr(inspect.unwrap(function), "__code__", None)) is None:
        return ""
    line = [code.co_firstlineno, *_lines(error, code.co_filename)][-1]
    return f"{Path(code.co_filename).name}, line {line}: "


def _lines(error: BaseException, file: str) -> list[int]:
    """The lines of a file through which an error came, the one that raised it last."""
    frames = traceback.extract_tb(error.__traceback__)
    return [frame.lineno or 0 for frame in frames if frame.filename == file]


def _said(error: BaseException) -> str:
    kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
    return " ".join(f"{kind}{error}".split())


def measure(signals: Signals, metrics: Iterable[Metric]) -> Measured:
    """The values of `metrics` in their order, and a line for each that cannot be had.

    A line like "no metrics of the grasp: plant lacks contact[1]". A function that fails, or that
    returns something else than a Metric may have, is a line like
    "metric 'own': own.py, line 12: ValueError: ...".
    """
    there, missing = available(metrics, signals.by_name, signals.roles)
    values: dict[str, Any] = {}
    failures = []
    for m in there:
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # a result must be finite anyway
                value = _plain(m, m.function(signals))
            some = value if isinstance(value, list) else [value]
            if not m.reason or any(v is not None for v in some):
                values[m.name] = value
        except MissingSignalError as error:
            missing.append(f"no {m.name}: {error}")
        except Exception as error:  # a user's function may raise anything
            failures.append(f"metric {m.name!r}: {_place(m.function, error)}{_said(error)}")
    found = tuple(m for m in there if m.name in values)
    return Measured(values, found, (*missing, *failures), tuple(failures))


def available(
    metrics: Iterable[Metric], names: Collection[str], roles: Mapping[str, str]
) -> tuple[list[Metric], list[str]]:
    """The metrics that signals of these `names` permit, and a line for each reason against one."""
    sized = [m.of(names, roles) for m in metrics]
    reasons = [(m, lacking(m.needs, names, roles)) for m in sized]
    there = [m for m, reason in reasons if not reason]
    in_part = {m.group for m in there}
    missing: dict[str, str] = {}
    for m, reason in reasons:
        if reason and not m.optional:
            whole = m.group and m.group not in in_part
            missing.setdefault(f"metrics of the {m.group}" if whole else m.name, reason)
    return there, [f"no {what}: {reason}" for what, reason in missing.items()]


def needed(
    metrics: Iterable[Metric], names: Collection[str], roles: Mapping[str, str]
) -> frozenset[str]:
    """The signals of these `names` that the metrics may read: all, where one is of no group."""
    there = available(metrics, names, roles)[0]
    if not all(m.group for m in there):
        return frozenset(names)
    return frozenset(resolved(name, roles) for m in there for name in m.needs)


def lacking(needs: Iterable[str], names: Collection[str], roles: Mapping[str, str]) -> str | None:
    """Why signals of these `names` do not have all that is needed; None where they do."""
    needs = tuple(need.replace(ALL, "[1]") for need in needs)
    for need in needs:
        if resolved(need, roles) in names:
            continue
        role, dot, variable = need.partition(".")
        component = roles.get(role, role)
        if not dot:
            return f"there is no signal {need}"
        there = {name.partition(".")[0] for name in names}
        if component in there:
            return f"{component} lacks {variable}"
        wanted = [need.removeprefix(role) for need in needs if need.startswith(f"{role}.")]
        able = [c for c in sorted(there) if all(f"{c}{variable}" in names for variable in wanted)]
        return f'no component is the {role}; name it under [roles]: {role} = "{[*able, "..."][0]}"'
    return None


def resolved(name: str, roles: Mapping[str, str]) -> str:
    """The name of a signal whose first part may be a role."""
    role, dot, variable = name.partition(".")
    return f"{roles.get(role, role)}{dot}{variable}"


def _plain(m: Metric, found: Any) -> Any:
    """Return the value of a metric with Python's own numbers, in a list."""
    plain = found.tolist() if isinstance(found, np.ndarray | np.generic) else found
    several = isinstance(plain, list | tuple)
    values = [v.item() if isinstance(v, np.generic) else v for v in (plain if several else [plain])]
    if not all(v is None or isinstance(v, bool | int | float) for v in values):
        raise InputError(f"returned {found!r}; must be a number, True, False, None or a list of it")
    if any(isinstance(v, float) and not isfinite(v) for v in values):
        raise InputError(f"returned {plain!r}; must be finite, None where there is no value")
    if m.entries and not (several and len(values) == len(m.entries)):
        raise InputError(f"returned {found!r}; must be a value for each of {choices(m.entries)}")
    return values if several else values[0]


def load_metrics(path: Path) -> tuple[Metric, ...]:
    """The metrics of a Python file, in the order in which they stand there.

    The file is run. InputError where it is no .py or cannot be read, or fails, or has no metric.
    """
    if path.suffix != ".py":
        raise InputError(f"--metrics {path}: must be a Python file, NAME.py")
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: {reason_of(error)}; must be a Python file") from error
    found = _run(path.name, text)
    if not found:
        raise InputError(f"--metrics {path}: no metric; must have functions under @metric(name)")
    return found


def _run(name: str, text: str) -> tuple[Metric, ...]:
    """The metrics of a file's text; run once per process and content."""
    module_name = f"grasp_cosim_metrics_{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    module = sys.modules.get(module_name)
    if module is None:
        module = ModuleType(module_name)
        sys.modules[module_name] = module
        try:
            exec(compile(text, name, "exec"), module.__dict__)  # noqa: S102 - the user's own
        except BaseException as error:
            del sys.modules[module_name]
            if not isinstance(error, Exception | SystemExit):
                raise
            lines = _lines(error, name)
            place = f"--metrics {name}{f', line {lines[-1]}' if lines else ''}"
            raise InputError(f"{place}: {_said(error)}") from error
    found = [value for value in vars(module).values() if isinstance(value, Metric)]
    return tuple(
        replace(m, origin=(name, text))
        for m in dict.fromkeys(found)
        if getattr(m.function, "__module__", module_name) == module_name  # not one it imported
    )


def _from_text(name: str, text: str, wanted: str) -> Metric:
    """The metric of that name from a file's text, in another process."""
    return next(m for m in _run(name, text) if m.name == wanted)
