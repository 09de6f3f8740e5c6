"""The result of a run: its data, how it is shown, and the files that are made of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from ..base.checks import extra_module, is_number
from ..base.errors import choices
from ..base.one_piece import in_one_piece
from ..base.registry import registered
from ..base.text import counted, on_a_screen
from ..exchange.listener import Listener
from ..metrics.groups import group_of
from ..metrics.metric import Metric
from .arrow import ArrowListener
from .csv import CsvListener
from .folder import ANY_PICTURE, save_run
from .mdf import MdfListener
from .recorded_run import RecordedRun

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

FEW = 3
"""So many names are in a line of a result's repr()."""


class View(NamedTuple):
    """How a result is shown beyond its numbers: a picture, which is drawn and may be written to a
    path, by the stem of its file, and whether it fits a result.

    `scene` makes what the page of such a result has in addition (`report.page.Scene`), or None;
    `traits` are what such a result is next to its settings, in words, like {"case": "2"}; `words`
    are those that a title has of it, like "case 2".
    """

    stem: str
    fits: Callable[[Any], bool]
    draw: Callable[[Any, Path | None], Any]
    scene: Callable[[Any], Any] = lambda _: None
    traits: Callable[[Any], Mapping[str, str]] = lambda _: {}
    words: Callable[[Any], Sequence[str]] = lambda _: ()


OF_ANY = View(
    ANY_PICTURE, lambda _: True, lambda run, path: registered("pictures", "Result")(run, path)
)
"""Of a result of any system."""


class Result(RecordedRun):
    """A run that was recorded, which shows itself and is written into files.

    Signals are by name, like result["plant.gap[1]"], on result.time in s; all that is known of the
    run is as of a RecordedRun.

    Example:
        >>> from grasp_cosim import grasp_system, simulate
        >>> result = simulate(grasp_system(), step=1e-3, stop=0.1)
        >>> float(result.time[-1]), result.units["plant.gap[1]"]
        (0.1, 'm')
        >>> bool(result["plant.gap[1]"].min() > 0.0)
        True
    """

    if TYPE_CHECKING:
        windows: tuple[Result, ...]

    def __repr__(self) -> str:
        """The system, its settings, metrics and signals in five lines."""
        return on_a_screen([*self._in_words()])

    def _repr_html_(self) -> str:
        """The run and its metrics, as notebooks show them."""
        return str(registered("html", "Result")(self))

    def save(self, folder: str | Path, form: Literal["csv", "arrow"] = "csv") -> None:
        """Write what `run --out` does, which load_run() reads: the signals and run.json.

        Args:
            folder: The folder of the run. An older run there is replaced.
            form: "csv" for signals.csv, "arrow" for signals.arrow.

        Raises:
            InputError: The folder has something else in it; or pyarrow is needed and not installed.
            SimulationError: A file cannot be written.
        """
        save_run(self, Path(folder), form)

    def to_csv(self, path: str | Path) -> None:
        """Write time and signals with full precision, a line for each communication point.

        Args:
            path: The file.

        Raises:
            InputError: The file cannot be written.
        """
        self._play(path, CsvListener)

    def to_arrow(self, path: str | Path) -> None:
        """Write time and signals as an Arrow file (Feather 2), with the units.

        Args:
            path: The file.

        Raises:
            InputError: The file cannot be written, or pyarrow is not installed.
        """
        self._play(path, ArrowListener)

    def to_mdf(self, path: str | Path) -> None:
        """Write time and signals as an ASAM MDF 4 file, with the units and the settings.

        Args:
            path: The file.

        Raises:
            InputError: The file cannot be written, or asammdf is not installed.
        """
        self._play(path, MdfListener)

    def plot(self, path: str | Path | None = None, title: str = "") -> Figure:
        """Draw a grasp as one, of any other system all signals.

        Args:
            path: Where the figure is written too, as .png, .svg or .pdf; None for nowhere.
            title: The title of the figure; by default that of the run.

        Returns:
            The figure of matplotlib.

        Raises:
            InputError: The path has another suffix, or matplotlib is not installed.
        """
        run, file = self.titled(title), None if path is None else Path(path)
        return self.view.draw(run, file)  # type: ignore[no-any-return]

    def to_pandas(self) -> pd.DataFrame:
        """The signals as a table of pandas.

        Returns:
            A DataFrame by time in s; its `attrs` have the units.

        Raises:
            InputError: pandas is not installed.
        """
        module = extra_module("pandas", "it makes the table", "pandas")
        index = module.Index(self.time, name="time")
        frame: pd.DataFrame = module.DataFrame(dict(self.signals), index=index)
        frame.attrs = {"units": {"time": "s", **self.units}, **self._about}
        return frame

    def to_xarray(self) -> xr.Dataset:
        """The signals as a data set of xarray.

        Returns:
            A Dataset over time in s, with `units` and `long_name`.

        Raises:
            InputError: xarray is not installed.
        """
        module = extra_module("xarray", "it makes the data set", "xarray")
        data: xr.Dataset = module.Dataset(attrs=self._about)
        data["time"] = "time", self.time, {"units": "s", "long_name": "time"}
        for name, column in self.signals.items():
            attributes = {"units": self.units.get(name), "long_name": self.descriptions.get(name)}
            # what there is none of is left out, as netCDF has it
            data[name] = "time", column, {key: text for key, text in attributes.items() if text}
        return data

    @property
    def _about(self) -> dict[str, Any]:
        """The run in a few words, for the attributes of a table."""
        return {key: self.settings[key] for key in ("system", "scheme", "step", "stop")}

    def _in_words(self) -> Iterator[str]:
        """The lines of its repr()."""
        settings, rows = self.settings, len(self.time)
        source = f", read from {self.folder}" if self.folder else ""
        yield f"Result of {settings['system']}{source}"
        end = f"{self.end_time:.6g} s of " if rows and not self.complete else ""
        duration = f", took {self.wall_time:.3g} s" if self.wall_time else ""
        broken = "" if self.complete else ", not complete"
        if self.ended_at is not None:
            broken = ", ended there"
        step, stop = 1e3 * settings["step"], settings["stop"]
        scheme = f"in steps of {step:.6g} ms, {settings['scheme']}"
        yield f"  run      {end}{stop:.6g} s {scheme}{duration}{broken}"
        windows = f" in {counted(len(self.windows), 'window')}" if self.is_triggered else ""
        yield f"  signals  {len(self)}, of {rows} rows{windows}: {choices(self, FEW)}"
        metrics = (_in_words(m, self.measured.values[m.name]) for m in self.measured.metrics)
        yield f"  metrics  {'; '.join([*metrics][:FEW]) or 'none'}"
        yield f"  log      {choices(self.log, 1) if self.log else 'nothing to report'}"

    @property
    def view(self) -> View:
        """How it is shown: of the first group of its metrics whose view fits, else any result's."""
        for group in map(group_of, self.groups):
            view: View | None = group.view() if group.view else None
            if view and view.fits(self):
                return view
        return OF_ANY

    def _play(self, path: str | Path, make: Callable[[Path, Path], Listener]) -> None:
        """Have a listener hear the recorded run again, which writes a file in a place."""
        with in_one_piece(Path(path)) as part:
            self.replay(make(Path(path), part))


def _in_words(metric: Metric, value: Any) -> str:
    """A metric and its value, as tables show it: time_to_contact 1.887, 1.897 s."""
    values = value if isinstance(value, list) else [value]
    texts = [
        f"{metric.factor * v:.4g}" if is_number(v) else "none" if v is None else str(v)
        for v in values
    ]
    return f"{metric.name} {', '.join(texts)} {metric.display_unit}".rstrip()
