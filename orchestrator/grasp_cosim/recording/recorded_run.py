"""A run as plain data: what was recorded at every communication point, and what follows of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, NoReturn, Self, overload

import numpy as np
import numpy.typing as npt

from ..base.by_name import ByName
from ..base.errors import UnknownNameError
from ..base.files import write_json
from ..exchange.listener import Experiment, Listener, OfWindows, Signal, Window
from ..interface.units import Conversion
from ..metrics.groups import metrics_of
from ..metrics.metric import Measured, Metric, Signals, Value, measure
from ..realtime.timing import Timing
from ..system.parts import Component
from ..system.settings import given_values
from ..system.times import NANOSECONDS, nearest_time
from .proxies import proxy_figures
from .verdict import Verdict, judge

KINDS = {"f": "Real", "i": "Integer", "b": "Boolean", "O": "String"}
"""The kind of a signal by the kind of its column's element type."""

PIECE = 8192
"""Rows written at once."""

UNITS: Mapping[str, str | None] = {
    "wall_time": "s", "real_time_factor": "1", "steps": "1", "scheme": None, "step": "s",
    "stop": "s", "complete": None,
}  # fmt: skip
"""Figures of every run next to its metrics, and their units."""


@dataclass(frozen=True, slots=True)
class Rejection:
    """Steps of a component that its FMU discarded or ended early: how many, the first in s."""

    count: int
    first: float


class Trip(NamedTuple):
    """A limit that was exceeded: its condition, what follows on it, when it first was, in s, by
    which value, and at how many communication points.
    """

    limit: str
    then: str
    first: float
    value: float
    steps: int


class Figures(dict[str, Any]):
    """Metrics and other figures by name; KeyError, with the nearest names, where there is none.

    A metric is a number, True or False, None where it has no value, or a list of these.
    """

    if TYPE_CHECKING:

        @overload
        def __getitem__(self, name: Literal["wall_time", "real_time_factor"]) -> float | None: ...
        @overload
        def __getitem__(self, name: Literal["step", "stop", "ended_at"]) -> float: ...
        @overload
        def __getitem__(self, name: Literal["steps"]) -> int: ...  # type: ignore[overload-overlap]
        @overload
        def __getitem__(self, name: Literal["complete"]) -> bool: ...
        @overload
        def __getitem__(self, name: Literal["scheme"]) -> str: ...  # type: ignore[overload-overlap]
        @overload
        def __getitem__(self, name: Literal["proxies"]) -> Mapping[str, Any]: ...  # type: ignore[overload-overlap]
        @overload
        def __getitem__(self, name: str) -> Value | list[Value]: ...
        def __getitem__(self, name: str) -> Any: ...

    def __missing__(self, name: str) -> NoReturn:
        raise UnknownNameError(name, tuple(self), "metric")

    def _ipython_key_completions_(self) -> list[str]:
        """The names, for Tab behind a bracket in a notebook."""
        return [*self]


@dataclass(frozen=True, slots=True)
class OfEveryStep:
    """The metrics, and the figures of the proxies by component."""

    measured: Measured
    proxies: Mapping[str, Any]

    @classmethod
    def without(
        cls, time: npt.NDArray[np.float64], signals: Mapping[str, npt.NDArray[Any]]
    ) -> OfEveryStep:
        """Those of a triggered run of which only the rows of its windows are there: no metrics."""
        line = "metrics of the run: none, as only the rows of windows are there"
        return cls(Measured({}, (), (line,)), proxy_figures(time, signals))


@dataclass(frozen=True, eq=False, repr=False)
class RecordedRun(ByName[npt.NDArray[Any]]):
    """The recorded signals of a run by name, like result["plant.gap[1]"], on result.time in s.

    It is the same whether it was just run or read back from a folder. A result is equal to itself
    only: whether two are alike says compare().
    """

    settings: Mapping[str, Any]
    """The settings of the run, as in run.json: system, step, stop, scheme, ..."""
    time: npt.NDArray[np.float64]
    """The recorded communication points in s, of the shape (rows,)."""
    signals: Mapping[str, npt.NDArray[Any]]
    """The columns by name, each of the shape (rows,): floats, whole numbers, Booleans, or str
    objects.
    """
    units: Mapping[str, str | None]
    """The unit of each signal, that of its FMU; None where it has none."""
    wall_time: float | None
    """The s that the run took, without the writing of files meanwhile; None where it did not end.
    """
    complete: bool
    """True where the stop time was reached: not where the run was interrupted, failed, or ended
    early.
    """
    descriptions: Mapping[str, str] = field(default_factory=dict)
    """What each signal is, by name."""
    rejections: Mapping[str, Rejection] = field(default_factory=dict)
    """By component, how often its FMU rejected a step; only those that did."""
    log: tuple[str, ...] = ()
    """Remarks on the run, a line each."""
    timing: Timing | None = None
    """How the run kept to the clock; None where it was not paced."""
    more_metrics: tuple[Metric, ...] = ()
    """The metrics of this run in addition to those of the system."""
    origin: Mapping[str, Any] = field(default_factory=dict)
    """The date, versions, command and title of a run with a folder: see recording.folder."""
    to_si: Mapping[str, Conversion] = field(default_factory=dict)
    """How those signals are converted to SI base units that are in others."""
    of_every_step: OfEveryStep | None = None
    """What was worked out of every step, where fewer rows were recorded."""
    folder: Path | None = None
    """The folder that it was read from; None of a run that was just done."""
    components: tuple[Component, ...] = ()
    """What ran; none of a run that was read."""
    ended_at: float | None = None
    """The time of the last row in s where an FMU, or `until`, ended the run before its stop time;
    else None.
    """
    limits: tuple[Trip, ...] = ()
    """The limits of the system that were exceeded."""
    initialised_anew: tuple[float, ...] = ()
    """The times in s at which the whole loop was initialised again, as a lost peer was back."""
    peers: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """By component that is a proxy, the name and the build of its last peer."""
    windows: tuple[RecordedRun, ...] = ()
    """The windows of a triggered run, each a result; the rows of the run are theirs, with gaps."""
    window: Window | None = None
    """Which window of a triggered run it is; None of a whole run."""
    steps_done: int | None = None
    """The steps of a triggered run, as its rows do not tell them; None of any other."""

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        """A signal of the run.

        Args:
            name: A name like "plant.gap[1]".

        Returns:
            The values of the shape (rows,), in the unit units[name], at the times `time`.

        Raises:
            KeyError: There is no such signal; with the names nearest to it.
        """
        if name not in self.signals:
            raise UnknownNameError(name, tuple(self.signals), "signal")
        return self.signals[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.signals)

    def __len__(self) -> int:
        return len(self.signals)

    def __getstate__(self) -> dict[str, Any]:
        """Only the data: what was worked out from it does not travel to other processes."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def roles(self) -> Mapping[str, str]:
        """The component that plays a role, where its name does not say it."""
        return dict(self.settings.get("roles", {}))

    @property
    def groups(self) -> Sequence[str]:
        """The groups of metrics that its system names."""
        return list(self.settings.get("metrics", ()))

    @property
    def given(self) -> dict[str, Any]:
        """The start values that the system sets, by names like plant.object_width."""
        return given_values(self.settings)

    @cached_property
    def by_role(self) -> Signals:
        """The signals as metrics take them: names may begin with a role, values are in SI units."""
        return Signals(self.time, self.signals, self.roles, self.to_si, self.given)

    @cached_property
    def measured(self) -> Measured:
        """The metrics, their units, and why others cannot be had."""
        if self.of_every_step:
            return self.of_every_step.measured
        return measure(self.by_role, metrics_of(self.groups, self.more_metrics))

    @property
    def every(self) -> int:
        """The steps from one row to the next: more than 1 where the recording was thinned."""
        if self.windows:
            return max(window.every for window in self.windows)
        return int(self._steps[1] - self._steps[0]) if len(self.time) > 1 else 1

    @property
    def last_step(self) -> int:
        """The number of the step at whose end the last row is, counted from the start.

        Of a triggered run that of the last step.
        """
        return int(self._steps[-1]) if self.steps_done is None else self.steps_done

    @property
    def is_triggered(self) -> bool:
        """True of a triggered run: it recorded windows, with gaps between them."""
        return self.steps_done is not None

    @property
    def end_time(self) -> float:
        """The time in s of that step."""
        if self.steps_done is None:
            return float(self.time[-1])
        return float(Experiment.of(self.settings).times(np.array([self.steps_done]))[0])

    @property
    def numbers(self) -> dict[str, npt.NDArray[Any]]:
        """The signals that are numbers or Booleans: all but Strings."""
        return {name: column for name, column in self.items() if column.dtype != object}

    @property
    def metrics(self) -> Figures:
        """The metrics by name, then the figures of UNITS, then those of any proxies.

        A metric is a number in its unit in `metric_units`, True or False, or None where it has no
        value. It may be a list of these, one for each finger for example.

        Raises:
            InputError: The function of a metric fails.
            KeyError: There is no metric of the name that is asked for; with the nearest names.
        """
        self.measured.check()
        return self._figures

    @cached_property
    def _figures(self) -> Figures:
        """The metrics without those that fail."""
        every_step, wall_time, settings = self.of_every_step, self.wall_time, self.settings
        simulated = self.end_time - settings.get("start", 0.0)
        proxies = every_step.proxies if every_step else proxy_figures(self.time, self.signals)
        figures = Figures(self.measured.values)
        figures["wall_time"] = wall_time
        figures["real_time_factor"] = simulated / wall_time if wall_time else wall_time
        figures["steps"] = self.last_step
        for key in ("scheme", "step", "stop"):
            figures[key] = settings[key]
        figures["complete"] = self.complete
        if self.ended_at is not None:
            figures["ended_at"] = self.ended_at
        if proxies:
            figures["proxies"] = proxies
        return figures

    @cached_property
    def verdict(self) -> Verdict:
        """The criteria of a run with a bench, in real time, with limits, or with limits of its
        metrics; none of any other, nor of a window. It prints as those that failed.
        """
        if self.window:
            return Verdict()
        has_steps = len(self.time) or self.steps_done
        return judge(
            self.settings,
            self.last_step if has_steps else 0,
            self._figures.get("proxies", {}),
            self.timing,
            len(self.limits),
            len(self.initialised_anew),
            self.came_to_its_end,
            self.measured.columns(),
            self.measured.units,
        )

    @property
    def passed(self) -> bool:
        """True if each criterion of the verdict is within its limit."""
        return all(criterion.passed for criterion in self.verdict)

    @property
    def came_to_its_end(self) -> bool:
        """True if it reached the stop time, or the end that an FMU asked for before."""
        return self.complete or self.ended_at is not None

    @property
    def metric_units(self) -> dict[str, str | None]:
        """The units of the metrics by name; None where a value has none."""
        early = {} if self.ended_at is None else {"ended_at": "s"}
        return {**self.measured.units, **UNITS, **early}

    def to_json(self, path: str | Path) -> None:
        """Write what is known of the run next to its signals as JSON: the run.json of its folder.

        These are the figures and the settings of the run, the metrics as "measured", and the number
        of rows; units, conversions to SI, types and descriptions by signal; the units of the
        metrics, the log, the rejections by component, the timing of a paced run, and its origin. A
        metric that fails is a line among the missing ones: the rest of the run is kept.

        Args:
            path: The file.
        """
        write_json(Path(path), self._report())

    def _report(self) -> dict[str, Any]:
        """The entries of run.json, in their order."""
        metrics = self.measured.values
        report = {name: value for name, value in self._figures.items() if name not in metrics}
        report |= self.settings
        report["measured"] = dict(metrics)
        report["rows"] = len(self.time)
        report["units"] = dict(self.units)
        report["to_si"] = {name: c._asdict() for name, c in self.to_si.items()}
        report["types"] = {name: _type_name(column) for name, column in self.signals.items()}
        report["descriptions"] = dict(self.descriptions)
        report["metric_units"] = self.metric_units
        report["missing_metrics"] = list(self.measured.missing)
        report["log"] = list(self.log)
        report["rejections"] = {name: asdict(r) for name, r in self.rejections.items()}
        if self.timing:
            report["timing"] = self.timing.as_dict()
        if self.limits:
            report["exceeded"] = [trip._asdict() for trip in self.limits]
        if self.initialised_anew:
            report["initialised_anew"] = list(self.initialised_anew)
        if self.peers:
            report["peers"] = {name: dict(peer) for name, peer in self.peers.items()}
        if self.verdict:
            report["verdict"] = [criterion.as_dict() for criterion in self.verdict]
        if self.window:
            report["window"] = asdict(self.window)
        if self.is_triggered:
            report["windows"] = [window.summary for window in self.windows]
        return report | dict(self.origin)

    @property
    def subfolder(self) -> str:
        """The name of its folder in that of its run; "" of a whole run, which has that one."""
        return self.window.folder if self.window else ""

    @property
    def summary(self) -> dict[str, Any]:
        """What is known of a window, as run.json of its run has it; times in s."""
        of_window = asdict(self.window) if self.window else {}
        begin, end = (float(self.time[i]) for i in (0, -1))
        rows = {"from": begin, "until": end, "rows": len(self.time)}
        return {"folder": self.subfolder, **of_window, **rows}

    def part(self, window: Window, rows: slice) -> Self:
        """The result of a window. It is complete if the run has not broken off in it.

        Args:
            window: The window.
            rows: Where its rows are in those of the run.

        Returns:
            The rows, and what is known of them.
        """
        when = self.settings["trigger"]["when"]
        return replace(
            self,
            time=self.time[rows],
            signals={name: column[rows] for name, column in self.signals.items()},
            wall_time=None,
            complete=window.complete or self.came_to_its_end,
            window=replace(window, complete=window.complete or self.came_to_its_end),
            log=(f"t = {window.time:.9g} s: recording {window.number}: {when}",),
            rejections={},
            timing=None,
            of_every_step=None,
            ended_at=None,
            limits=(),
            initialised_anew=(),
            windows=(),
            steps_done=None,
        )

    def titled(self, title: str) -> Self:
        """The result under another title, which its pictures and pages have.

        Args:
            title: The title; "" for the one that it has.

        Returns:
            A copy, or the result itself.
        """
        return replace(self, origin={**self.origin, "title": title}) if title else self

    @cached_property
    def _steps(self) -> npt.NDArray[np.int64]:
        """The numbers of the recorded communication points, shape (rows,)."""
        since = self.time - self.settings.get("start", 0.0)
        per_s = float(NANOSECONDS / nearest_time(self.settings["step"]))
        return np.asarray(np.rint(since * per_s), np.int64)

    def replay(self, listener: Listener) -> None:
        """Have a listener hear the recorded run again.

        Args:
            listener: Gets the recorded rows: see exchange.listener.
        """
        descriptions = self.descriptions
        signals = [
            Signal(name, self.units[name], KINDS[column.dtype.kind], descriptions.get(name, ""))
            for name, column in self.items()
        ]
        with ExitStack() as stack:
            listener.begin(Experiment.of(self.settings), signals)
            stack.callback(listener.end, self.complete)
            if not self.is_triggered or not isinstance(listener, OfWindows):
                self._replay_rows(listener, signals)
                return
            listener.begin_run()
            for part in self.windows:
                if part.window:
                    listener.begin_window(part.window)
                    part._replay_rows(listener, signals)
                    listener.end_window(part.window)

    def _replay_rows(self, listener: Listener, signals: Sequence[Signal]) -> None:
        for first in range(0, len(self.time), PIECE):
            steps = self._steps[first : first + PIECE]
            rows = np.empty((len(steps), len(signals)))
            for i, (signal, column) in enumerate(zip(signals, self.values(), strict=True)):
                values = column[first : first + PIECE]
                text = signal.kind == "String"
                rows[:, i] = [*map(signal.texts.number, values)] if text else values
            listener.block(steps, rows)


def _type_name(column: npt.NDArray[Any]) -> str:
    """The element type of a column as run.json names it: "str" for Strings."""
    return "str" if column.dtype == object else str(column.dtype)
