"""Whole signals of all runs of a sweep, on disk: a store of Zarr, which xarray opens.

A run writes its own as it ends, a file for each signal, in one piece; what is not there is NaN. So
nothing goes through memory or between processes, and a sweep that goes on has what was written. It
is format 3 of Zarr (zarr-specs.readthedocs.io) without compression, which takes no package.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError
from ..base.files import make_folder, write_json
from ..base.one_piece import in_one_piece
from ..base.scratch import ScratchFolder
from ..base.typed_json import Decoder, json_in
from ..exchange.listener import Experiment
from ..metrics.metric import Metric
from ..recording.memory import writing
from ..recording.result import Result
from ..system.description import System
from ..system.settings import settings
from .rows import STOP, TIMES, Row

HEAD = "zarr.json"
"""The file of what a group or an array is."""

GroupAttributes = TypedDict("GroupAttributes", {"signals of the sweep": str})
"""The attribute by which a store is ours: a hash of what decides the runs."""


class GroupHead(TypedDict):
    """What is read here of the HEAD of a store."""

    attributes: GroupAttributes


RUN, TIME = "run", "time"

_ZARR = {"zarr_format": 3}

_ELEMENT = re.compile(r"(.+)\[(\d+)\]")


@dataclass(frozen=True)
class Array:
    """The signals that are the elements of an array, or a single one, and how it is shown."""

    signals: tuple[str, ...]
    dimension: str | None
    unit: str | None
    description: str

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Their names, in order."""
        return (RUN, TIME, self.dimension) if self.dimension else (RUN, TIME)

    @property
    def size(self) -> tuple[int, ...]:
        """How many elements there are, along the dimension of these."""
        return (len(self.signals),) if self.dimension else ()


@dataclass(frozen=True)
class Store:
    """What is kept of each run, and where: arrays by name, at each n-th communication point."""

    folder: Path
    arrays: Mapping[str, Array]
    rows: int
    every: int = 1

    def blocks(self, result: Result) -> dict[str, bytes]:
        """What is written of a run, by array: its rows, then NaN where it ended early."""
        blocks = {}
        for name, array in self.arrays.items():
            block = np.full((self.rows, len(array.signals)), np.nan, "<f8")
            for i, signal in enumerate(array.signals):
                column = result[signal][:: self.every]
                block[: len(column), i] = column
            blocks[name] = block.tobytes()
        return blocks

    def write(self, run: int, blocks: Mapping[str, bytes]) -> None:
        """Write what there is of a run; OSError where that fails."""
        for name, block in blocks.items():
            with in_one_piece(self._file(name, run)) as part:
                part.write_bytes(block)

    def has(self, run: int) -> bool:
        """True if all of a run is there."""
        return all(self._file(name, run).is_file() for name in self.arrays)

    def taken(self, run: int) -> dict[str, bytes]:
        """What there is of a run, which is removed."""
        files = {name: self._file(name, run) for name in self.arrays}
        blocks = {name: file.read_bytes() for name, file in files.items() if file.is_file()}
        for name in blocks:
            files[name].unlink()
        return blocks

    def column(self, name: str, runs: int) -> npt.NDArray[np.float64]:
        """All runs of an array, of the shape (runs, rows) or with its elements behind."""
        array = self.arrays[name]
        values = np.full((runs, self.rows, *array.size), np.nan)
        for run in range(runs):
            file = self._file(name, run)
            if file.is_file():
                values[run] = np.fromfile(file, "<f8").reshape(values.shape[1:])
        return values

    def _file(self, name: str, run: int) -> Path:
        """The chunk of a run: the key of Zarr has its index along each dimension."""
        chunk_indices = [run, *(0 for _ in self.arrays[name].dimensions[1:])]
        return self.folder / name / ".".join(map(str, chunk_indices))


@dataclass(frozen=True)
class Recorded:
    """The signals of the runs of a table; the folder of those without `out` goes with them."""

    store: Store
    time: npt.NDArray[np.float64]
    scratch: ScratchFolder | None = None


def recording(system: System, signals: Sequence[str] | str) -> tuple[System, list[str]]:
    """The system that records these signals, too, and their names; InputError as of with_record().

    Also where one is a String.
    """
    patterns = [signals] if isinstance(signals, str) else signals
    requested = system.with_record(*patterns)
    for port, variable in requested.recorded.items():
        if variable.kind == "String":
            raise InputError(f"signals: {port} is a String; must be numbers or Booleans")
    names = sorted(requested.recorded_names, key=_in_order)
    if requested.recorded_names <= system.recorded_names:
        return system, names
    both = system.recorded_names | requested.recorded_names
    return system.with_record(*sorted(both, key=_in_order)), names


def times(system: System, rows: Sequence[Row], every: int) -> npt.NDArray[np.float64]:
    """Each n-th communication point of the longest run in s; InputError where steps differ."""
    for row in rows:
        for place in row:
            if place in TIMES and place != STOP:
                raise InputError(
                    f"signals: the rows vary {place}; must be one for all, as the time is"
                )
    stops = {row.get(STOP) for row in rows}
    longest = max(_until(system, stop).total_steps for stop in stops)
    steps = np.arange(0, longest + 1, every)
    return Experiment.of(settings(system)).times(steps)


def _until(system: System, stop: Any) -> System:
    return system if stop is None else system.with_settings({STOP: stop})


def arrays(system: System, names: Sequence[str], metrics: Iterable[Metric]) -> dict[str, Array]:
    """The arrays of which signals are all elements, plant.gap[1] and so on, and the other signals.

    The elements are along the dimension of metrics of as many, like finger.
    """
    dimensions = {len(m.entries): dimension(m)[0] for m in metrics if m.entries}
    variables = {str(port): variable for port, variable in system.observed.items()}
    arrays_by_name = {}
    for name, signals in _grouped(names).items():
        variable = variables.get(signals[0])
        is_array = signals != (name,)
        size = len(signals)
        arrays_by_name[name.replace("/", "_")] = Array(
            signals,
            dimensions.get(size, f"element_{size}") if is_array else None,
            variable.unit if variable else None,
            (variable.description if variable else None) or "",
        )
    return arrays_by_name


def dimension(metric: Metric) -> tuple[str, Sequence[Any]]:
    """The name of the dimension of a metric of several entries, and what is along it.

    Of "finger 1", "finger 2" these are finger, and 1, 2.
    """
    word = metric.entries[0].rpartition(" ")[0]
    numbers = range(1, len(metric.entries) + 1)
    if word and metric.entries == tuple(f"{word} {i}" for i in numbers):
        return word.replace(" ", "_"), list(numbers)
    return f"{metric.name}_entry", metric.entries


def _grouped(names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Signals by the array that they are all elements of, else by their own names."""
    members: dict[str, list[str]] = {}
    for name in names:
        element = _ELEMENT.fullmatch(name)
        members.setdefault(element[1] if element else name, []).append(name)
    groups: dict[str, tuple[str, ...]] = {}
    for array, signals in members.items():
        all_elements = [f"{array}[{i}]" for i in range(1, len(signals) + 1)]
        if len(signals) > 1 and signals == all_elements:
            groups[array] = tuple(signals)
        else:
            groups |= {name: (name,) for name in signals}
    return groups


def _in_order(name: str) -> list[Any]:
    """A key by which x[2] comes before x[10]."""
    parts = re.split(r"(\d+)", name)
    return [int(part) if part.isdigit() else part for part in parts]


# ------------------------------------------------------------------------- what Zarr says of it


def begin(
    recorded: Recorded, rows: Sequence[Row], identity: Mapping[str, str], goes_on: bool
) -> None:
    """Make the store of the runs of these rows, unless it is there and the sweep `goes_on`.

    Columns of numbers are coordinates of the runs. InputError where the folder is of something
    else, or the store cannot be made.
    """
    store, key = recorded.store, _joined(identity)
    if store.folder.exists():
        if _key(store.folder) == key and goes_on:
            return
        shutil.rmtree(store.folder)
    with writing(store.folder, InputError):
        along_runs = {RUN: [*range(len(rows))], **_numbers(rows)}
        heads = _write_coordinates(recorded, along_runs)
        attributes = {"signals of the sweep": key}
        coordinates = [name for name in along_runs if name != RUN]
        if coordinates:
            attributes["coordinates"] = " ".join(coordinates)
        head = {
            **_ZARR,
            "node_type": "group",
            "attributes": attributes,
            "consolidated_metadata": {
                "kind": "inline",
                "must_understand": False,
                "metadata": heads,
            },
        }
        write_json(store.folder / HEAD, head)


def _key(folder: Path) -> str:
    """The hash of what the runs of a store are of; InputError where it is none of our own."""
    try:
        content = json_in(str(folder / HEAD), (folder / HEAD).read_bytes())
        head = Decoder().decoded(GroupHead, str(folder / HEAD), content)
        return head["attributes"]["signals of the sweep"]
    except (OSError, InputError) as error:
        raise InputError(
            f"{folder}: is there, and has no signals of a sweep; remove it, or name another out"
        ) from error


def _joined(identity: Mapping[str, str]) -> str:
    return sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def _numbers(rows: Sequence[Row]) -> dict[str, list[float]]:
    """The columns of rows that are numbers, NaN where a row leaves its place."""
    numbers = {}
    for place in dict.fromkeys(place for row in rows for place in row):
        column = [row.get(place, np.nan) for row in rows]
        if all(isinstance(value, int | float) for value in column):
            numbers[place] = [float(value) for value in column]
    return numbers


def _write_coordinates(
    recorded: Recorded, along_runs: Mapping[str, Sequence[float]]
) -> dict[str, Any]:
    """Write the coordinates, and the heads of all arrays, before any run; the heads by name."""
    store, heads = recorded.store, {}
    for name, array in store.arrays.items():
        shape = len(along_runs[RUN]), store.rows, *array.size
        attributes = {"units": array.unit, "long_name": array.description}
        heads[name] = _head(shape, (1, *shape[1:]), array.dimensions, attributes)
    dimensions: dict[str, str] = {TIME: TIME}
    coordinates: dict[str, Any] = {TIME: recorded.time}
    for array in store.arrays.values():
        if array.dimension:
            dimensions[array.dimension] = array.dimension
            coordinates[array.dimension] = [*range(1, len(array.signals) + 1)]
    for name, values in along_runs.items():
        dimensions[name] = RUN
        coordinates[name] = values
    for name, values in coordinates.items():
        numbers = np.asarray(values, "<f8")
        units = {"units": "s"} if name == TIME else {}
        heads[name] = _head(numbers.shape, numbers.shape, (dimensions[name],), units)
        make_folder(store.folder / name)
        (store.folder / name / "0").write_bytes(numbers.tobytes())
    for name, head in heads.items():
        write_json(store.folder / name / HEAD, head)
    return heads


def _head(
    shape: Sequence[int],
    chunk: Sequence[int],
    dimensions: Sequence[str],
    attributes: Mapping[str, Any],
) -> dict[str, Any]:
    """The content of the file HEAD of an array."""
    return {
        **_ZARR,
        "node_type": "array",
        "shape": list(shape),
        "data_type": "float64",
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": list(chunk)}},
        "chunk_key_encoding": {"name": "v2", "configuration": {"separator": "."}},
        "fill_value": "NaN",
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
        "attributes": {key: text for key, text in attributes.items() if text},
        "dimension_names": list(dimensions),
    }
