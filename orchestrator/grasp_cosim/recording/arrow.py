"""Apache Arrow: a listener that writes columns while the run goes on.

The file is of the IPC format (Feather 2): a signal is a field with its unit and description in the
metadata. Until its end is written it is a stream of whole batches; so a file can be read that a
kill left behind, as far as the last of them (tables/arrow_file.py).
"""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError
from ..exchange.listener import Experiment, Signal
from ..tables.arrow_file import pyarrow
from .memory import TYPES, Batch, typed, writing

BATCH = 4096
"""Rows that are written together, if they do not take longer than LONG to come."""

LONG = 0.5
"""s of wall time."""


class ArrowListener:
    """Writes time and signals at path, or into another `place`, which messages do not name."""

    def __init__(self, path: str | Path, place: Path | None = None) -> None:
        """InputError without pyarrow."""
        self._path, self._arrow = Path(path), pyarrow()
        self._place = (place or self._path).absolute()  # an FMU may go elsewhere

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Write the schema; InputError where the file cannot be written."""
        arrow = self._arrow
        types = {kind: arrow.from_numpy_dtype(dtype) for kind, dtype in TYPES.items()}
        types["String"] = arrow.string()
        self._experiment, self._signals = experiment, signals
        fields = [arrow.field("time", arrow.float64(), metadata={"unit": "s"})]
        for signal in signals:
            metadata = {"unit": signal.unit or "", "description": signal.description}
            kind = "Real" if signal.wide else signal.kind
            fields.append(arrow.field(signal.name, types[kind], metadata=metadata))
        self._schema = arrow.schema(fields)
        self._batch, self._since = Batch(), -LONG  # the first rows are written as they come
        with writing(self._path, InputError):
            self._file = self._place.open("wb")
            self._writer = arrow.ipc.new_file(self._file, self._schema)
            self._file.flush()

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Take the rows; SimulationError where writing fails, the batches until then are whole."""
        self._batch.add(steps, rows)
        if self._batch.count >= BATCH or time.monotonic() - self._since >= LONG:
            self._flush()

    def end(self, complete: bool) -> None:
        """Write what is left, and the end of the file; SimulationError where that fails."""
        with writing(self._path), self._file:  # closed even where that fails
            if self._batch.count:
                self._flush()
            self._writer.close()

    def _flush(self) -> None:
        steps, rows = self._batch.take()
        self._since = time.monotonic()
        typed_columns = (
            np.ascontiguousarray(rows[:, i] if signal.wide else typed(signal, rows[:, i]))
            for i, signal in enumerate(self._signals)
        )
        columns = [self._experiment.times(steps), *typed_columns]
        with writing(self._path):
            self._writer.write_batch(self._arrow.record_batch(columns, schema=self._schema))
            self._file.flush()
