"""Reads back the folder that a run left behind: signals.csv and run.json."""

import csv
import json
import logging
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from si_units import known_unit

from ..base.checks import choice, extra_module, is_number, real
from ..base.errors import InputError, choices
from ..base.files import check_nature
from ..base.numerals import counted
from ..base.plain_text import from_cell
from ..interface.units import Conversion
from ..metrics.metric import Measured, Metric, Signals, metrics_of
from ..realtime.timing import Timing
from .arrow import pyarrow, read_arrow
from .mdf import check_mdf
from .result import UNITS, Known, Rejection, Result

SIGNALS, ARROW, SETTINGS = "signals.csv", "signals.arrow", "run.json"
"""The files of a run's folder, of which it has one of the former two."""

LARGE = 20_000_000
"""Bytes of a file that is worth another reader."""

NUMBER = (int, float)
MAYBE = (int, float, type(None))

SETTINGS_THERE: Mapping[str, Any] = {
    "system": str, "scheme": str, "step": NUMBER, "stop": NUMBER, "initialisation": dict,
    "components": dict, "connections": list, "events": list, "faults": list,
}  # fmt: skip
SETTINGS_MAYBE: Mapping[str, Any] = {
    "roles": dict, "input": dict, "changed": dict, "metrics": list, "diverging": str,
    "start": NUMBER,
}  # fmt: skip
"""Entries of run.json that say how the run was made, and of which types they are."""

ORIGIN: Mapping[str, Any] = {
    "title": str, "date": str, "versions": dict, "fmus": dict, "command": list,
}  # fmt: skip
"""Entries that say when it was made, and with what; they may be there."""

REQUIRED: Mapping[str, Any] = {
    **SETTINGS_THERE, "wall_time": MAYBE, "complete": bool, "log": list, "rejections": dict,
    "units": dict,
}  # fmt: skip
OPTIONAL: Mapping[str, Any] = {
    **SETTINGS_MAYBE, **ORIGIN, "types": dict, "descriptions": dict, "metric_units": dict,
    "to_si": dict,
}  # fmt: skip
"""All entries besides metrics."""

TEXT = "str"
TYPES = ("float64", "int32", "int64", "bool", TEXT)
"""The element types of recorded columns, the last that of Strings."""

FORMS = {
    str: "a string", NUMBER: "a number", MAYBE: "a number or null", bool: "true or false",
    list: "a list",
}  # fmt: skip
"""Types of entries in words; the others are JSON objects."""


def run_folder(path: Path) -> Path:
    """The folder of a run, which one of its files names as well; InputError where it is none."""
    if path.name in (SIGNALS, ARROW, SETTINGS) and path.is_file():
        return path.parent
    check_nature(path, "run")
    return path


def load_run(folder: str | Path) -> Result:
    """The result in a folder that `run --out` wrote, or is writing: then as far as it got.

    One of its files stands for it.

    Metrics are worked out anew from the signals; those of a user's file, and of a run that recorded
    only some of its steps, are as they were recorded.
    InputError where a file is missing or damaged, or the two files are not of the same run.
    """
    folder = run_folder(Path(folder))
    path = folder / SETTINGS
    written = _settings(path)
    units, types = written["units"], written.get("types", {})
    arrow = folder / ARROW
    if not units and not (folder / SIGNALS).exists() and not arrow.exists():
        raise InputError(f"{path}: this run recorded no signal; must have recorded one")
    unfinished = not written["complete"] and written["wall_time"] is None
    texts = {n for n, kind in types.items() if kind == TEXT}
    if arrow.exists():
        time, columns = read_arrow(arrow)
    else:
        time, columns = _table(folder / SIGNALS, texts, unfinished)
    if list(units) != list(columns):
        raise InputError(
            f"{path}: units are those of {choices(units)}; "
            f"must be those of the recorded columns: {choices(columns)}"
        )
    return _result(path, written, time, columns)


def result_with(
    path: Path, time: npt.NDArray[np.float64], columns: Mapping[str, npt.NDArray[Any]]
) -> Result:
    """The result with these signals that the run.json at path is of, which to_json() wrote."""
    return _result(path, _settings(path), time, columns)


def _result(
    path: Path,
    written: Mapping[str, Any],
    time: npt.NDArray[np.float64],
    columns: Mapping[str, npt.NDArray[Any]],
) -> Result:
    realtime, types = written.get("realtime"), written.get("types", {})
    read = Result(
        settings={k: written[k] for k in (*SETTINGS_THERE, *SETTINGS_MAYBE) if k in written},
        time=time,
        signals={
            name: _typed(f"{path}: type of {name}", column, types.get(name, "float64"))
            for name, column in columns.items()
        },
        units=written["units"],
        wall_time=written["wall_time"],
        complete=written["complete"],
        descriptions=written.get("descriptions", {}),
        rejections=_rejections(f"{path}: rejections", written["rejections"]),
        log=tuple(written["log"]),
        timing=None if realtime is None else Timing.from_dict(f"{path}: realtime", realtime),
        more_metrics=_as_recorded(written),
        origin={key: written[key] for key in ORIGIN if key in written},
        to_si=_to_si(f"{path}: to_si", written),
        folder=path.parent,
    )
    return _with_known(read, written) if read.every > 1 else read


def _with_known(read: Result, written: Mapping[str, Any]) -> Result:
    """A result of thinned rows with the metrics that run.json has, which are of every step."""
    asked = metrics_of(read.groups, read.more_metrics)
    there = tuple(m for m in asked if m.name in written)
    if not asked:
        return read
    if not there:  # it did not come to its end
        line = f"one row in {read.every} was recorded: the metrics are of these"
        return replace(read, log=(*read.log, line))
    values = {m.name: written[m.name] for m in there}
    measured = Measured(values, there, tuple(written.get("missing_metrics", ())))
    return replace(read, known=Known(measured, written.get("proxies", {})))


def _rejections(place: str, found: Mapping[str, Any]) -> dict[str, Rejection]:
    try:
        return {name: Rejection(int(r["count"]), float(r["first"])) for name, r in found.items()}
    except (KeyError, TypeError, ValueError) as error:
        said = f"{type(error).__name__}: {error}"
        raise InputError(f"{place}: is damaged ({said}); must have count and first each") from error


def _to_si(place: str, written: Mapping[str, Any]) -> dict[str, Conversion]:
    """The conversions to SI; of an earlier run.json by the names of its units."""
    if "to_si" not in written:
        return dict(_known(written["units"]))
    found: dict[str, Conversion] = {}
    for name, entry in written["to_si"].items():
        if entry is None:  # of an earlier version, which did not take it to be in SI
            continue
        numbers = [entry.get(key) for key in Conversion._fields] if isinstance(entry, dict) else []
        if not (numbers and all(map(is_number, numbers))):
            raise InputError(f"{place}: {name} = {entry!r}; must be factor and offset")
        found[name] = Conversion(*map(float, numbers))  # type: ignore[arg-type]
    return found


def _known(units: Mapping[str, Any]) -> dict[str, Conversion]:
    """The conversions to SI of signals whose units are known by their names, and not of SI."""
    known = {name: known_unit(str(unit or "")) for name, unit in units.items()}
    return {n: Conversion(u.factor, u.offset) for n, u in known.items() if u and not u.si}


def _as_recorded(written: Mapping[str, Any]) -> tuple[Metric, ...]:
    """The metrics in run.json that nothing here would work out again, as they are there."""
    known = {*UNITS, *(m.name for m in metrics_of(written.get("metrics", ())))}
    return tuple(
        Metric(name, partial(_constant, written[name]), unit)
        for name, unit in written.get("metric_units", {}).items()
        if name not in known and name in written
    )


def _constant(value: Any, _: Signals) -> Any:
    return value


def load_log(path: Path, note: Callable[[str], None] | None = None) -> Signals:
    """The numbers in a file, all float64: CSV with the column "time" and names, or ASAM MDF (.mf4).

    They come in SI units where the run.json of the run beside it tells of others, or the channels
    of an MDF do; else they are taken to be in SI, which `note` is told of a CSV. InputError where
    it is missing, damaged or of another kind, or where asammdf is not installed.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such log; must be a .csv or .mf4 file")
    if path.suffix.lower() == ".mf4":
        time, columns, units = read_mdf(path)
        log = Signals(time, columns, to_si=_known(units))
    elif path.suffix.lower() == ".csv":
        time, columns = _table(path)
        log = Signals(time, {n: c for n, c in columns.items() if c.dtype != object})
    else:
        raise InputError(f"{path}: must be a .csv or .mf4 file")
    beside = path.with_name(SETTINGS)
    if path.stem != Path(SIGNALS).stem or not beside.is_file():
        if note and path.suffix.lower() == ".csv":
            note(
                f"{path}: there is no {SETTINGS} beside it; its values are taken to be in SI units"
            )
        return log
    return replace(log, to_si=_to_si(f"{beside}: to_si", _settings(beside)))


def read_mdf(
    path: Path,
) -> tuple[npt.NDArray[np.float64], dict[str, npt.NDArray[np.float64]], dict[str, str]]:
    """Every channel of the first group that has samples, on its master in s, and their units.

    InputError without asammdf, or where it is damaged or has none.
    """
    check_mdf()
    from asammdf import MDF

    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # what is wrong is ours to say
    try:
        with MDF(path) as mdf:
            channels = [c for c in mdf.iter_channels() if len(c.samples)]
    except Exception as error:  # of a damaged file it raises whatever it stumbles over
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"{path}: is damaged, not an MDF file: {said}") from error
    if not channels:
        raise InputError(f"{path}: no channel has samples; must be a recorded log")
    time = channels[0].timestamps
    numbers = [
        c for c in channels if c.samples.shape == time.shape and c.samples.dtype.kind in "fiub"
    ]
    return (
        time,
        {c.name: c.samples.astype(np.float64) for c in numbers},
        {c.name: str(c.unit) for c in numbers},
    )


def _settings(path: Path) -> dict[str, Any]:
    """The object in run.json; its mappings by signal are mappings."""
    try:
        settings = json.loads(path.read_text("utf-8"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is damaged, not UTF-8 text: {error.reason}") from error
    except OSError as error:
        raise _unreadable(path, error) from error
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: is damaged, not JSON: {error}") from error
    if not isinstance(settings, dict):
        raise InputError(f"{path}: is {type(settings).__name__}; must be a JSON object")
    for key, kind in {**REQUIRED, **OPTIONAL}.items():
        if key not in settings and key in REQUIRED:
            raise InputError(
                f"{path}: no entry {key!r}; must be as `grasp-cosim run --out` writes it"
            )
        wrong = not isinstance(settings.get(key), kind)
        a_number = kind in (NUMBER, MAYBE)
        if key in settings and (wrong or (a_number and isinstance(settings[key], bool))):
            form = FORMS.get(kind, "a JSON object")
            raise InputError(f"{path}: {key} = {settings[key]!r}; must be {form}")
    return settings


def _unreadable(path: Path, error: OSError) -> InputError:
    return InputError(
        f"{path}: {error.strerror}; must be a folder that `grasp-cosim run --out` wrote"
    )


def _table(
    path: Path, texts: Collection[str] | None = None, torn: bool = False
) -> tuple[npt.NDArray[np.float64], dict[str, npt.NDArray[Any]]]:
    """The time, and the other columns by name: objects where they are texts, else float64.

    `texts` are the names of those, by default of all that begin with something else than a number.
    A last row that is `torn` does not count.
    """
    names = _header(path, torn)
    count = path.read_bytes().count(b"\n") - 1 if torn else None
    try:
        texts = _not_numbers(path, names) if texts is None else texts
        columns = _texts(path, names, texts, count) if texts else {}
        places = [0, *(i for i, name in enumerate(names, 1) if name not in columns)]
        some: dict[str, Any] = {"usecols": places, "quotechar": '"'} if columns else {}
        table = [] if columns or torn else _fast(path, len(places))
        if not table:
            table = [
                *np.loadtxt(
                    path,
                    delimiter=",",
                    skiprows=1,
                    comments=None,
                    ndmin=2,
                    encoding="utf-8",
                    max_rows=count,
                    **some,
                ).T
            ]
    except (ValueError, csv.Error) as error:  # also where it is no UTF-8
        raise InputError(f"{path}: is damaged: {str(error).splitlines()[0]}") from error
    if len(table) != len(places):
        raise InputError(f"{path}: is damaged: {_uneven(len(table), names)}")
    if not (np.diff(table[0], prepend=-np.inf) > 0.0).all():
        raise InputError(f"{path}: is damaged: the time must grow from row to row")
    columns |= {names[i - 1]: table[k] for k, i in enumerate(places[1:], 1)}
    return table[0], {name: columns[name] for name in names}


def _fast(path: Path, width: int) -> list[npt.NDArray[np.float64]]:
    """The columns of a large file, if pyarrow is here, and nothing is wrong with them.

    They have the same bits, in a tenth of the time.
    """
    if path.stat().st_size < LARGE:
        return []
    with suppress(InputError):
        arrow, reader = pyarrow(), extra_module("pyarrow.csv", "it reads CSV", "arrow")
        names = [str(i) for i in range(width)]
        try:
            table = reader.read_csv(
                path,
                reader.ReadOptions(skip_rows=1, column_names=names),
                convert_options=reader.ConvertOptions(
                    column_types=dict.fromkeys(names, arrow.float64()), null_values=[]
                ),
            )
        except arrow.ArrowInvalid:  # which the other reader says better
            return []
        return [column.to_numpy() for column in table]
    return []


def _texts(
    path: Path, names: Sequence[str], wanted: Collection[str], count: int | None
) -> dict[str, npt.NDArray[Any]]:
    """The columns of these names that are texts; ValueError where a row has not all values."""
    places = {i: name for i, name in enumerate(names, 1) if name in wanted}
    cells: dict[str, list[str]] = {name: [] for name in places.values()}
    for row in islice(_rows(path), count):
        if len(row) != len(names) + 1:
            raise ValueError(_uneven(len(row), names))
        for i, name in places.items():
            cells[name].append(from_cell(row[i]))
    return {name: np.array(column, object) for name, column in cells.items()}


def _uneven(values: int, names: Sequence[str]) -> str:
    """What is wrong with a row of so many values, the time among them."""
    return f"{counted(values, 'value')} in a row, {counted(len(names) + 1, 'name')}"


def _not_numbers(path: Path, names: Sequence[str]) -> set[str]:
    """The names of the columns that begin with something else than a number."""
    first = next(_rows(path), [])[1:]
    return {name for name, cell in zip(names, first, strict=False) if not _is_number(cell)}


def _rows(path: Path) -> Iterator[list[str]]:
    """The rows after the names."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = csv.reader(file, strict=True)
        next(rows)
        yield from rows


def _is_number(cell: str) -> bool:
    try:
        real(cell)
    except ValueError:
        return False
    return True


def _header(path: Path, torn: bool) -> list[str]:
    """The names of the columns after time; InputError where no whole row follows them.

    Where the last one may be `torn`, another one must be before it.
    """
    try:
        with path.open("rb") as file:
            first = file.readline()
            file.seek(max(len(first), file.seek(0, os.SEEK_END) - 1))
            end = file.read()
            file.seek(len(first))
            end = b"\n" if torn and file.readline().endswith(b"\n") else end
    except OSError as error:
        raise _unreadable(path, error) from error
    try:
        cells = next(csv.reader([first.decode("utf-8")], strict=True), [])
        time, *names = [from_cell(cell) for cell in cells] or ["nothing"]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: is damaged: the first line names no columns") from error
    if time != "time":
        raise InputError(f'{path}: the first column is {time!r}; must be "time"')
    if len(set(names)) != len(names):
        raise InputError(f"{path}: is damaged: two columns have the same name")
    if end != b"\n":
        raise InputError(f"{path}: is damaged: the last row is cut off, or there is none")
    return names


def _typed(place: str, column: npt.NDArray[Any], name: Any) -> npt.NDArray[Any]:
    """The column with the element type of that name; InputError where its values have another."""
    if choice(place, name, TYPES) == TEXT or column.dtype == name:
        return column
    with np.errstate(invalid="ignore"):
        typed = column.astype(name)
    if not np.array_equal(typed, column, equal_nan=name == "float64"):
        value = column[np.flatnonzero(typed != column)[0]]
        raise InputError(f"{place} = {name}: must be a type of its values, like {value:g}")
    return typed
