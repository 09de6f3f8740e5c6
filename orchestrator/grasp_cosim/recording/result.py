"""What a simulation leaves behind: every output at every communication point."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..files import in_one_piece, write_text
from ..grasp.metrics import grasp_metrics
from ..realtime.timing import Timing
from ..system.description import System
from ..system.parts import NANOSECONDS
from ..system.settings import settings
from .listener import Listener, Signal
from .proxies import proxy_figures

KINDS = {"f": "Real", "i": "Integer", "b": "Boolean"}
"""The kind of a signal by the kind of its column's element type."""

PIECE = 8192
"""Rows written at once."""


@dataclass(frozen=True, slots=True)
class Rejection:
    """Steps of a component that its FMU discarded or ended early: how many, the first in s."""

    count: int
    first: float


@dataclass(frozen=True, eq=False)
class Result(Mapping[str, npt.NDArray[Any]]):
    """Recorded signals by name, like result["plant.gap[1]"], on result.time in s."""

    system: System
    time: npt.NDArray[np.float64]
    signals: Mapping[str, npt.NDArray[Any]]
    units: Mapping[str, str | None]
    wall_time: float
    complete: bool
    """False where the run was interrupted or an FMU failed."""
    descriptions: Mapping[str, str] = field(default_factory=dict)
    rejections: Mapping[str, Rejection] = field(default_factory=dict)
    """By component; only those that rejected steps."""
    log: tuple[str, ...] = ()
    """What is worth knowing about the run, a line each."""
    timing: Timing | None = None
    """How it kept to the clock; None where it was not paced."""

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        return self.signals[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.signals)

    def __len__(self) -> int:
        return len(self.signals)

    @cached_property
    def metrics(self) -> Mapping[str, Any]:
        """The figures of `run --json`.

        Those of the grasp only if there is a gripper plant, those of proxies if there are any.
        """
        simulated = float(self.time[-1])
        return {
            **grasp_metrics(self.time, self.signals),
            "wall_time": self.wall_time,
            "real_time_factor": simulated / self.wall_time if self.wall_time else 0.0,
            "steps": int(self._steps[-1]),
            "scheme": self.system.scheme,
            "step": self.system.step_ns / NANOSECONDS,
            "stop": self.system.stop_ns / NANOSECONDS,
            "complete": self.complete,
            **({"proxies": proxies} if (proxies := proxy_figures(self.time, self.signals)) else {}),
        }

    def to_csv(self, path: str | Path) -> None:
        """Write time and signals with full precision, a line per communication point."""
        from .csv import CsvListener  # which needs this module

        with in_one_piece(Path(path)) as part:
            self._play(CsvListener(part))

    def to_mdf(self, path: str | Path) -> None:
        """Write an ASAM MDF 4 file with the units and the settings; InputError without asammdf."""
        from .mdf import MdfListener  # which needs this module

        with in_one_piece(Path(path)) as part:
            self._play(MdfListener(part))

    def to_json(self, path: str | Path) -> None:
        """Write the metrics and the settings() that led to them, then what is known by signal
        (units, types, descriptions), the log, the rejections by component, and, as "realtime",
        the timing of a paced run.
        """
        report = {
            **self.metrics,
            **settings(self.system),
            "units": dict(self.units),
            "types": {name: str(column.dtype) for name, column in self.signals.items()},
            "descriptions": dict(self.descriptions),
            "log": list(self.log),
            "rejections": {name: asdict(r) for name, r in self.rejections.items()},
            **({"realtime": self.timing.as_dict()} if self.timing else {}),
        }
        write_text(Path(path), json.dumps(report, indent=2) + "\n")

    @cached_property
    def _steps(self) -> npt.NDArray[np.int64]:
        """The numbers of the recorded communication points."""
        return np.rint(self.time * (NANOSECONDS / self.system.step_ns)).astype(np.int64)

    def _play(self, listener: Listener) -> None:
        """Have a listener hear the recorded run again."""
        signals = [
            Signal(
                name, self.units[name], KINDS[column.dtype.kind], self.descriptions.get(name, "")
            )
            for name, column in self.signals.items()
        ]
        listener.begin(self.system, signals)
        try:
            for first in range(0, len(self.time), PIECE):
                piece = slice(first, first + PIECE)
                steps = self._steps[piece]
                rows = np.empty((len(steps), len(signals)))
                for i, column in enumerate(self.signals.values()):
                    rows[:, i] = column[piece]
                listener.block(steps, rows)
        finally:
            listener.end(self.complete)

    def plot(self, path: str | Path) -> None:
        """Draw the grasp as a PNG; InputError without matplotlib or without a gripper plant."""
        from ..report.plot import plot_run  # which needs this module

        plot_run(self, Path(path))
