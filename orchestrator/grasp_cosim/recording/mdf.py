"""Writes a run as ASAM MDF 4 while it goes on, with asammdf (the optional extra `mdf`)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from one_piece import in_one_piece

from ..base.checks import extra_module
from ..base.errors import InputError, SimulationError
from ..base.files import unwritable
from ..exchange.listener import Experiment, Signal

if TYPE_CHECKING:
    import asammdf

TYPES = {"Real": np.float64, "Integer": np.int64, "Boolean": np.uint8, "String": np.uint32}
"""The element type of a channel by its signal's kind."""

TRANSPOSED_DEFLATE: Final = 2
"""The compression of the file; a column's values stand together, so that they compress well."""

PIECE = 8192
"""Rows handed to asammdf at once: it keeps a few hundred bytes about each piece."""


class MdfListener:
    """Writes time and signals as one channel group, with units and descriptions.

    A String is recorded as the numbers of its texts, which its channel has as a conversion, so that
    readers show them. The header has the settings of the run: all of them as JSON in its comment,
    and the main ones as properties, with "complete" besides. asammdf keeps the rows in a compressed
    temporary file beside path; the file at path is made from it when the run ends, in whatever way.
    There is no file where nothing was recorded.
    """

    def __init__(self, path: str | Path, said: str | Path | None = None) -> None:
        """`said` is the name in messages, if it is another. InputError without asammdf."""
        check_mdf()
        self._path, self._said = Path(path), Path(said or path)

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Describe the channels; InputError where there are none or the folder is not writable."""
        from asammdf import MDF

        if not signals:
            raise InputError(f"{self._said}: nothing to record; must be a system with outputs")
        self._experiment, self._signals = experiment, signals
        self._types = [TYPES[s.kind] for s in signals]
        self._steps, self._rows = np.empty(PIECE, np.int64), np.empty((PIECE, len(signals)))
        self._filled = 0
        folder = self._path.parent
        try:
            folder.mkdir(parents=True, exist_ok=True)
            # the first version with compressed blocks; every tool of today reads it
            self._mdf = MDF(version="4.10", temporary_folder=str(folder))
        except OSError as error:
            raise InputError(unwritable(self._said, error)) from error
        self._mdf.append([_channel(s) for s in signals], comment="", common_timebase=True)

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Take the rows; SimulationError where they cannot be written."""
        first = 0
        while first < len(steps):
            last = min(len(steps), first + PIECE - self._filled)
            piece = slice(self._filled, self._filled + last - first)
            self._steps[piece], self._rows[piece] = steps[first:last], rows[first:last]
            self._filled, first = piece.stop, last
            if self._filled == PIECE:
                self._flush()

    def end(self, complete: bool) -> None:
        """Make the file; SimulationError where that fails, and there is none."""
        try:
            with closing(self._mdf):
                self._flush()
                if self._mdf.groups[0].channel_group.cycles_nr:
                    self._mdf.header.comment = _comment(self._experiment, complete)
                    self._convert_texts()
                    with in_one_piece(self._path) as part, part.open("wb+") as file:
                        self._mdf.save(file, compression=TRANSPOSED_DEFLATE)
        except OSError as error:  # also of close(), which writes what is still in a buffer
            raise SimulationError(unwritable(self._said, error)) from error

    def _convert_texts(self) -> None:
        from asammdf.blocks.conversion_utils import from_dict

        channels: Any = self._mdf.groups[0].channels[1:]  # the first is time
        for channel, signal in zip(channels, self._signals, strict=True):
            if signal.kind == "String":
                table: dict[str, Any] = {}
                for number, text in enumerate(signal.texts.listed):
                    table |= {f"val_{number}": number, f"text_{number}": text}
                channel.conversion = from_dict(table)

    def _flush(self) -> None:
        rows = self._rows[: self._filled].T
        time = self._experiment.times(self._steps[: self._filled])
        channels = [c.astype(element) for c, element in zip(rows, self._types, strict=True)]
        try:
            self._mdf.extend(0, [(samples, None) for samples in (time, *channels)])
        except OSError as error:
            raise SimulationError(unwritable(self._said, error)) from error
        self._filled = 0


def check_mdf() -> None:
    """InputError without asammdf."""
    extra_module("asammdf", "it writes MDF files", "mdf")


def _channel(signal: Signal) -> asammdf.Signal:
    from asammdf import Signal as Channel

    return Channel(
        samples=np.empty(0, TYPES[signal.kind]),
        timestamps=np.empty(0),
        name=signal.name,
        unit=signal.unit or "",
        comment=signal.description,
    )


def _comment(experiment: Experiment, complete: bool) -> str:
    """The header's comment, in the XML that MDF 4 asks for."""
    root = ElementTree.Element("HDcomment")
    ElementTree.SubElement(root, "TX").text = json.dumps(experiment.settings)
    properties = ElementTree.SubElement(root, "common_properties")
    for name, value in {**experiment.settings, "complete": complete}.items():
        if not isinstance(value, dict | list):
            ElementTree.SubElement(properties, "e", name=name).text = json.dumps(value)
    return ElementTree.tostring(root, encoding="unicode")
