"""A metric: a function of recorded signals, with a name, a unit and a description.

The function gets a Signals: names begin with a role or a component, and values are in SI base
units. It returns a number, True or False, None where the moment never comes, or a list of these,
one per finger for instance. An example: docs/how_to/metric.md.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import count
from math import isfinite
from pathlib import Path
from pkgutil import resolve_name
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.by_name import ByName
from ..base.checks import install_command
from ..base.errors import InputError, choices, nearest
from ..base.errors import reason as reason_of
from ..base.pickles import as_bytes
from ..base.registry import in_every_process, registered
from ..base.si_units import refusal
from ..interface.units import Conversion

Value = float | bool | None
RESERVED = frozenset((
    "complete", "ended_at", "error", "index", "missing_metrics", "proxies",
    "real_time_factor", "realtime", "scheme", "step", "steps", "stop", "units", "verdict",
    "wall_time", "windows",
))  # fmt: skip
"""Names next to metrics in what `run --json` prints, and in the table of a sweep."""


ALL = "[*]"
"""Ends the name of an array of which a metric takes all elements."""


@dataclass(frozen=True, slots=True)
class AnyOf:
    """A need that any one of several signals meets: AnyOf(("plant.gap", "plant.contact")).

    Args:
        names: The names of the signals.

    Example:
        >>> from grasp_cosim import AnyOf, metric
        >>> @metric("touched", needs=[AnyOf(("plant.contact[1]", "plant.gap[1]"))])
        ... def touched(run):
        ...     return "plant.contact[1]" in run
        >>> touched.needs[0].names
        ('plant.contact[1]', 'plant.gap[1]')
    """

    names: tuple[str, ...]


Need = str | AnyOf
"""What there must be: a signal, or any one of several."""

Needs = Collection[Need] | Mapping[Need, str | None]
"""What a metric needs; a mapping gives the SI unit in which each is expected, or None."""


class MissingSignalError(KeyError):
    """A signal that a metric needs was not recorded; its text names the signal and the reason."""

    def __str__(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True, eq=False, repr=False)
class Signals(ByName[npt.NDArray[Any]]):
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
    """What one metric leaves for the next, by their own keys; signals in SI units by name."""

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        """The signal; MissingSignalError where it was not recorded."""
        reason = lacking((name,), self.by_name, self.roles)
        own = resolved(name, self.roles)
        if reason:
            component = own.partition(".")[0]
            if any(signal.startswith(f"{component}.") for signal in self.by_name):
                near = nearest(own, self.by_name)
                reason += f"; a signal that is no output must be recorded, --record {own}; {near}"
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

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and resolved(name, self.roles) in self.by_name

    def __iter__(self) -> Iterator[str]:
        return iter(self.by_name)

    def __len__(self) -> int:
        return len(self.by_name)


Function = Callable[[Signals], Value | Sequence[Value]]


@dataclass(frozen=True, slots=True, eq=False)
class Metric:
    """A function of recorded signals and how its value is named and shown.

    A metric of a system has a value where the signals that it needs are recorded, whatever others
    of its group lack; the reason is given once for all that lack the same. As an argument or an
    entry, `plant.gap[*]` stands for all elements of an array, and `finger *` for one name each.

    Args:
        name: An identifier, the name of its column.
        function: Gets the Signals of a run, in SI base units. It returns a number, True or False,
            None where the moment never comes, or a list of these.
        unit: The unit of the value, an SI one; "1" for a share, None for true or false.
        description: What it is, in a line.
        label: The title in tables and pictures; by default the name in words.
        factor: Tables show the value times this ...
        shown_unit: ... in this unit; None for `unit`.
        entries: The names of the values, where it has several: ("finger 1", "finger 2").
        needs: The signals without which it has no value, AnyOf where one of several will do. A
            mapping gives the SI unit in which each is expected, or None, so that one of another
            quantity is refused before a run.
        uses: The signals that it reads in addition, where they are recorded; as `needs`.
        group: The package of the group that it is of; "" for a user's own.
        optional: True leaves it out in silence where it has no value.
        reason: True says why other metrics have no value. It is left out where it has none itself,
            and a qualification does not compare it.
        none: What having no value means: "nothing was touched".
        origin: The name and the text of the file that it is from, by which it travels to other
            processes.

    Example:
        >>> from grasp_cosim import Metric, grasp_system, simulate
        >>> def final_gap(run):
        ...     return float(run["plant.gap[1]"][-1])
        >>> gap = Metric("final_gap", final_gap, unit="m", needs=["plant.gap[1]"])
        >>> result = simulate(grasp_system(), step=1e-3, stop=0.1, metrics=[gap])
        >>> bool(result.metrics["final_gap"] == result["plant.gap[1]"][-1])
        True
    """

    name: str
    function: Function
    unit: str | None = None
    description: str = ""
    label: str = ""
    factor: float = 1.0
    shown_unit: str | None = None
    entries: tuple[str, ...] = ()
    needs: Needs = ()
    uses: Needs = ()
    group: str = ""
    optional: bool = False
    reason: bool = False
    none: str = ""
    origin: tuple[str, str] | None = None

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
        """The units that it expects of signals, by name: those of what it `uses` go first."""
        return {**_units(self.needs), **_units(self.uses)}

    @property
    def reads(self) -> tuple[str, ...]:
        """The names of all signals that it needs or uses."""
        names = (name for need in (*self.needs, *self.uses) for name in names_of(need))
        return tuple(dict.fromkeys(names))

    @property
    def arrays(self) -> tuple[str, ...]:
        """The arrays, like plant.gap[*], that it needs all elements of."""
        names = (name for need in self.needs for name in names_of(need))
        return tuple(name for name in names if name.endswith(ALL))

    def column_title(self, column: str) -> str:
        """The title of one of its columns: "time to contact, finger 1".

        Args:
            column: One of `columns`.

        Returns:
            The title.
        """
        place = self.columns.index(column)
        return f"{self.title}, {self.entries[place]}" if self.entries else self.title

    def of(self, names: Collection[str], roles: Mapping[str, str]) -> Metric:
        """The metric with as many elements as its first array has in a run.

        Args:
            names: The names of the signals of the run.
            roles: The component by role, where its name does not say it.

        Returns:
            The metric without `[*]` and `*`.
        """
        if not self.arrays:
            return self
        sizes = (_elements(array, names, roles) for array in self.arrays)
        elements = range(1, next((size for size in sizes if size), 1) + 1)

        def by_element(text: str) -> list[str]:
            return [text.replace("*", str(j)) for j in elements]

        entries = dict.fromkeys(entry for several in self.entries for entry in by_element(several))
        needs, uses = expanded(self.needs, by_element), expanded(self.uses, by_element)
        return replace(self, needs=needs, uses=uses, entries=tuple(entries))

    def __call__(self, signals: Signals) -> Value | Sequence[Value]:
        """Return what its function does, so that other functions can call it."""
        return self.function(signals)

    def __reduce__(self) -> tuple[Any, ...]:
        """To another process a metric goes by the text of its file, or by where it is found."""
        if self.origin is not None:
            return _from_text, (*self.origin, self.name)
        if self.group and in_every_process("groups", self.group):
            of_group = registered("groups", self.group).metrics
            if any(self.function is m.function for m in of_group):
                return _of_group, (self.group, self.name, self.needs, self.uses, self.entries)
        module, name = (getattr(self.function, key, "") for key in ("__module__", "__qualname__"))
        there = module != "__main__" and getattr(sys.modules.get(module), name, None)
        if there is self:  # it replaced its function there
            return resolve_name, (f"{module}:{name}",)
        return Metric, tuple(getattr(self, field) for field in self.__dataclass_fields__)


def _of_group(group: str, name: str, needs: Needs, uses: Needs, entries: tuple[str, ...]) -> Metric:
    """The metric of that name of a group, in another process."""
    metrics: Sequence[Metric] = registered("groups", group).metrics
    of_group = next(m for m in metrics if m.name == name)
    return replace(of_group, needs=needs, uses=uses, entries=entries)


# ------------------------------------------------------------------------- what it reads


def names_of(need: Need) -> tuple[str, ...]:
    """The names of the signals any one of which a need is met by."""
    return need.names if isinstance(need, AnyOf) else (need,)


def expanded(needs: Needs, names_for: Callable[[str], Sequence[str]]) -> Needs:
    """The needs with all the names that a function gives in the place of each, in their units.

    Of AnyOf the first ones together are a need, and the second ones: all must have as many.
    """
    units = needs if isinstance(needs, Mapping) else dict.fromkeys(needs)
    expanded_needs: dict[Need, str | None] = {}
    for need, unit in units.items():
        if isinstance(need, AnyOf):
            alternatives = zip(*map(names_for, need.names), strict=True)
            expanded_needs |= {AnyOf(names): unit for names in alternatives}
        else:
            expanded_needs |= dict.fromkeys(names_for(need), unit)
    return expanded_needs if isinstance(needs, Mapping) else tuple(expanded_needs)


def _units(needs: Needs) -> dict[str, str | None]:
    """The units of signals by name, where the needs tell them."""
    units = needs if isinstance(needs, Mapping) else {}
    return {name: unit for need, unit in units.items() for name in names_of(need)}


def _elements(array: str, names: Collection[str], roles: Mapping[str, str]) -> int:
    """How many elements of an array, like plant.gap[*], signals of these `names` have."""
    element = array.replace("*", "{}").format
    return next(j for j in count() if resolved(element(j + 1), roles) not in names)


def metric(name: str, **more: Any) -> Callable[[Function], Metric]:
    """Make a Metric of the function below.

    Args:
        name: An identifier, the name of the metric and of its column.
        **more: The other arguments of Metric by name. Without `description` it is the first line of
            the docstring of the function.

    Returns:
        The decorator, which takes the function and returns the Metric.

    Raises:
        InputError: The name is no identifier, or is RESERVED; or a unit is none of SI.

    Example:
        >>> import numpy as np
        >>> from grasp_cosim import metric, simulate, grasp_system
        >>> @metric("peak_force", unit="N", needs={"plant.contact_force[1]": "N"})
        ... def peak_force(run):
        ...     "The largest contact force of finger 1."
        ...     return float(np.max(run["plant.contact_force[1]"]))
        >>> result = simulate(grasp_system(), step=1e-3, stop=2.0, metrics=[peak_force])
        >>> round(result.metrics["peak_force"], 2)
        1.22
    """
    if not name.isidentifier():
        raise InputError(f"metric {name!r}: must be a name of letters, digits and _")
    if name in RESERVED:
        raise InputError(f"metric {name!r}: is a figure of every run; must have another name")
    for unit in (more.get("unit"), more.get("shown_unit")):
        if unit and (reason := refusal(unit)):
            raise InputError(f"metric {name!r}: {reason}")

    def decorate(function: Function) -> Metric:
        first, *_ = (function.__doc__ or "").strip().splitlines() or [""]
        return Metric(name, function, **{"description": first, **more})

    return decorate


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
        return self.columns()

    def columns(self) -> dict[str, Value]:
        """The same of those metrics that did not fail."""
        values: dict[str, Value] = {}
        for name, value in self.values.items():
            if isinstance(value, list):
                values.update({f"{name}[{i}]": v for i, v in enumerate(value, start=1)})
            else:
                values[name] = value
        return values


def check_portable(metrics: Iterable[Metric]) -> None:
    """InputError where a metric cannot go to other processes."""
    for m in metrics:
        try:
            as_bytes(m)
        except Exception as error:  # pickle has one for each reason
            raise InputError(
                f"metric {m.name!r}: cannot go to another process ({_error_text(error)}); must be "
                "a function in a module or in a file of metrics, or cloudpickle be there: "
                f"{install_command('cloudpickle')}"
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


def _error_text(error: BaseException) -> str:
    kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
    return " ".join(f"{kind}{error}".split())


def measure(signals: Signals, metrics: Iterable[Metric]) -> Measured:
    """The values of `metrics` in their order, and a line for each reason why others have none.

    A line like "no object_shift, object_drift: plant lacks object_position". A function that fails,
    or that returns something else than a Metric may have, is a line like
    "metric 'own': own.py, line 12: ValueError: ...".
    """
    permitted, missing = available(metrics, signals.by_name, signals.roles)
    values: dict[str, Any] = {}
    failures = []
    for m in permitted:
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # a result must be finite anyway
                value = _plain(m, m.function(signals))
            some = value if isinstance(value, list) else [value]
            if not m.reason or any(v is not None for v in some):
                values[m.name] = value
        except MissingSignalError as error:
            if m.group:
                missing.append(f"no {m.name}: {error}")
            else:
                failures.append(f"metric {m.name!r}: {_place(m.function, error)}{error}")
        except Exception as error:  # a user's function may raise anything
            failures.append(f"metric {m.name!r}: {_place(m.function, error)}{_error_text(error)}")
    measured = tuple(m for m in permitted if m.name in values)
    return Measured(values, measured, (*missing, *failures), tuple(failures))


def available(
    metrics: Iterable[Metric], names: Collection[str], roles: Mapping[str, str]
) -> tuple[list[Metric], list[str]]:
    """The metrics that signals of these `names` permit, and a line for each reason against some."""
    judged = _with_reasons(metrics, names, roles)
    lost: dict[str, list[Metric]] = {}
    for m, reason in judged:
        if reason and not m.optional:
            lost.setdefault(reason, []).append(m)
    lines = [f"no {_together(some, judged)}: {reason}" for reason, some in lost.items()]
    return [m for m, reason in judged if not reason], lines


def reasons_against(
    metrics: Iterable[Metric], names: Collection[str], roles: Mapping[str, str]
) -> dict[str, str | None]:
    """Why signals of these `names` do not permit a metric, by its name; None where they do."""
    return {m.name: reason for m, reason in _with_reasons(metrics, names, roles)}


MetricsWithReasons = Sequence[tuple[Metric, str | None]]
"""Metrics, each with the reason why it cannot be had, None where it can."""


def _with_reasons(
    metrics: Iterable[Metric], names: Collection[str], roles: Mapping[str, str]
) -> MetricsWithReasons:
    """The metrics of as many elements as there are, and why signals of these `names` lack them."""
    return _judged(tuple(metrics), tuple(names), tuple(roles.items()))


@lru_cache(maxsize=16)
def _judged(
    metrics: tuple[Metric, ...], names: tuple[str, ...], roles: tuple[tuple[str, str], ...]
) -> MetricsWithReasons:
    """As _with_reasons(); a thousand runs of one system ask it once."""
    known, component_of = frozenset(names), dict(roles)
    sized = [m.of(known, component_of) for m in metrics]
    every = [need for m in sized for need in m.needs]
    return tuple((m, lacking(m.needs, known, component_of, every)) for m in sized)


def _together(lost: Sequence[Metric], judged: MetricsWithReasons) -> str:
    """The names of metrics that cannot be had for one reason, those of a group as in _in_group."""
    by_group: dict[str, list[str]] = {}
    for m in lost:
        by_group.setdefault(m.group, []).append(m.name)
    return ", ".join(_in_group(group, names, judged) for group, names in by_group.items())


def _in_group(group: str, lost: Sequence[str], judged: MetricsWithReasons) -> str:
    """The names of lost metrics of a group; where they are most of it, those that are left."""
    of_group = [(m, reason) for m, reason in judged if m.group == group]
    usual = [m for m, _ in of_group if not m.optional]
    if not group or 2 * len(lost) <= len(usual):
        return ", ".join(lost)
    remaining = ", ".join(m.name for m, reason in of_group if not reason)
    return f"metrics of the {group}{' but ' if remaining else ''}{remaining}"


def needed(
    metrics: Iterable[Metric], names: Collection[str], roles: Mapping[str, str]
) -> frozenset[str]:
    """The signals of these `names` that the metrics may read: all, where one is of no group."""
    permitted = available(metrics, names, roles)[0]
    if not all(m.group for m in permitted):
        return frozenset(names)
    return frozenset(resolved(name, roles) for m in permitted for name in m.reads) & {*names}


def optional_signals(
    metrics: Iterable[Metric], names: Collection[str], roles: Mapping[str, str]
) -> tuple[str, ...]:
    """The signals that metrics use where they are there, and that none of them needs."""
    sized = [m.of(names, roles) for m in metrics]
    needed_by_any = {name for m in sized for need in m.needs for name in names_of(need)}
    used = (name for m in sized for need in m.uses for name in names_of(need))
    return tuple(resolved(n, roles) for n in dict.fromkeys(used) if n not in needed_by_any)


def lacking(
    needs: Collection[Need],
    names: Collection[str],
    roles: Mapping[str, str],
    every: Collection[Need] = (),
) -> str | None:
    """Why signals of these `names` do not have all that is needed; None where they do.

    Where nobody plays a role, the component is named that has most of what the `needs`, or `every`
    one of several metrics, ask of it.
    """
    for need in needs:
        if any(resolved(name, roles) in names for name in names_of(need)):
            continue
        reasons = (
            _reason_of_role(of, names, roles, every or needs) for of in _by_role(need).values()
        )
        return " and ".join(dict.fromkeys(reasons))
    return None


def _by_role(need: Need) -> dict[str, tuple[str, ...]]:
    """The names of a need by their first parts."""
    names: dict[str, tuple[str, ...]] = {}
    for name in names_of(need):
        role = name.partition(".")[0]
        names[role] = (*names.get(role, ()), name)
    return names


def _reason_of_role(
    alternatives: Sequence[str],
    names: Collection[str],
    roles: Mapping[str, str],
    every: Collection[Need],
) -> str:
    """Why there is none of several signals of one role."""
    role, dot, _ = alternatives[0].partition(".")
    component = roles.get(role, role)
    if not dot:
        return f"there is no signal {alternatives[0]}"
    components = {name.partition(".")[0] for name in names}
    if component in components:
        variables = ", ".join(name.partition(".")[2] for name in alternatives)
        return f"{component} {'has none of' if len(alternatives) > 1 else 'lacks'} {variables}"
    of_role = {name for need in every for name in names_of(need) if name.startswith(f"{role}.")}
    has = {
        c: sum(resolved(name, {role: c}) in names for name in of_role) for c in sorted(components)
    }
    best = max(has, key=has.__getitem__, default="")
    player = best if has.get(best) else "..."
    return f'no component is the {role}; name it under [roles]: {role} = "{player}"'


def resolved(name: str, roles: Mapping[str, str]) -> str:
    """The name of a signal whose first part may be a role."""
    role, dot, variable = name.partition(".")
    return f"{roles.get(role, role)}{dot}{variable}"


def _plain(m: Metric, value: Any) -> Any:
    """Return the value of a metric with Python's own numbers, in a list."""
    plain = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    several = isinstance(plain, list | tuple)
    values = [v.item() if isinstance(v, np.generic) else v for v in (plain if several else [plain])]
    if not all(v is None or isinstance(v, bool | int | float) for v in values):
        raise InputError(f"returned {value!r}; must be a number, True, False, None or a list of it")
    if any(isinstance(v, float) and not isfinite(v) for v in values):
        raise InputError(f"returned {plain!r}; must be finite, or None if there is no value")
    if m.entries and not (several and len(values) == len(m.entries)):
        raise InputError(f"returned {value!r}; must be a value for each of {choices(m.entries)}")
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
    metrics = _run(path.name, text)
    if not metrics:
        raise InputError(f"--metrics {path}: no metric; must have functions under @metric(name)")
    return metrics


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
            raise InputError(f"{place}: {_error_text(error)}") from error
    metrics = [value for value in vars(module).values() if isinstance(value, Metric)]
    return tuple(
        replace(m, origin=(name, text))
        for m in dict.fromkeys(metrics)
        if getattr(m.function, "__module__", module_name) == module_name  # not one it imported
    )


def _from_text(name: str, text: str, metric_name: str) -> Metric:
    """The metric of that name from a file's text, in another process."""
    return next(m for m in _run(name, text) if m.name == metric_name)
