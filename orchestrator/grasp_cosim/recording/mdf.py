"""ASAM MDF 4 by asammdf (the optional extra `mdf`): written while a run goes on, and read."""

import json
import logging
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from one_piece import in_one_piece

from ..base.checks import extra_module
from ..base.errors import InputError
from ..exchange.listener import Experiment, Signal
from .memory import Batch, writing

TYPES = {"Real": np.float64, "Integer": np.int64, "Boolean": np.uint8, "String": np.uint32}
"""The element type of a channel by its signal's kind."""

TRANSPOSED_DEFLATE: Final = 2
"""The compression of the file; a column's values stand together, so that they compress well."""

PIECE = 8192
"""Rows handed to asammdf at once: it keeps a few hundred bytes about each piece."""


def check_mdf() -> None:
    """InputError without asammdf."""
    extra_module("asammdf", "it writes MDF files", "mdf")


class MdfListener:
    """Writes time and signals as one channel group, with units and descriptions.

    A String is recorded as the numbers of its texts, which its channel has as a conversion, so that
    readers show them. The header has the settings of the run: all of them as JSON in its comment,
    and the main ones as properties, with "complete" besides. asammdf keeps the rows in a compressed
    temporary file beside path; the file at path is made from it when the run ends, in whatever way.
    There is no file where nothing was recorded.
    """

    def __init__(self, path: str | Path, place: Path | None = None) -> None:
        """Written into another `place`, messages name path. InputError without asammdf."""
        check_mdf()
        self._path = Path(path)
        self._place = place or self._path

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Describe the channels; InputError where there are none or the folder is not writable."""
        from asammdf import MDF
        from asammdf import Signal as Channel

        if not signals:
            raise InputError(f"{self._path}: nothing to record; must be a system with outputs")
        self._experiment, self._signals, none = experiment, signals, np.empty(0)
        self._batch = Batch()
        folder = self._path.parent
        with writing(self._path, InputError):
            folder.mkdir(parents=True, exist_ok=True)
            # the first version with compressed blocks; every tool of today reads it
            self._mdf = MDF(version="4.10", temporary_folder=str(folder))
        channels = [
            Channel(none.astype(TYPES[s.kind]), none, s.unit or "", s.name, comment=s.description)
            for s in signals
        ]
        self._mdf.append(channels, comment="", common_timebase=True)

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Take the rows; SimulationError where they cannot be written."""
        self._batch.add(steps, rows)
        if self._batch.count >= PIECE:
            self._flush()

    def end(self, complete: bool) -> None:
        """Make the file; SimulationError where that fails, and there is none."""
        # also of close(), which writes what is still in a buffer
        with writing(self._path), closing(self._mdf):
            if self._batch.count:
                self._flush()
            if self._mdf.groups[0].channel_group.cycles_nr:
                self._describe(complete)
                with in_one_piece(self._place) as part, part.open("wb+") as file:
                    self._mdf.save(file, compression=TRANSPOSED_DEFLATE)

    def _describe(self, complete: bool) -> None:
        """Write the header's comment, in the XML that MDF 4 asks for, and the texts of Strings."""
        from asammdf.blocks.conversion_utils import from_dict

        root, settings = ElementTree.Element("HDcomment"), self._experiment.settings
        ElementTree.SubElement(root, "TX").text = json.dumps(settings)
        properties = ElementTree.SubElement(root, "common_properties")
        for name, value in {**settings, "complete": complete}.items():
            if not isinstance(value, dict | list):
                ElementTree.SubElement(properties, "e", name=name).text = json.dumps(value)
        self._mdf.header.comment = ElementTree.tostring(root, encoding="unicode")
        channels: Any = self._mdf.groups[0].channels[1:]  # the first is time
        for channel, signal in zip(channels, self._signals, strict=True):
            if signal.kind == "String":
                table: dict[str, Any] = {}
                for number, text in enumerate(signal.texts.listed):
                    table |= {f"val_{number}": number, f"text_{number}": text}
                channel.conversion = from_dict(table)

    def _flush(self) -> None:
        steps, rows = self._batch.take()
        pairs = zip(rows.T, self._signals, strict=True)
        own = (column.astype(TYPES[signal.kind]) for column, signal in pairs)
        with writing(self._path):
            self._mdf.extend(0, [(c, None) for c in (self._experiment.times(steps), *own)])


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
    time, found, units = channels[0].timestamps, {}, {}
    for c in channels:
        if c.samples.shape == time.shape and c.samples.dtype.kind in "fiub":
            found[c.name], units[c.name] = c.samples.astype(np.float64), str(c.unit)
    return time, found, units
