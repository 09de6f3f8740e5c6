"""ASAM MDF 4 by asammdf (the optional extra `mdf`): written when a run has ended, and read."""

import json
import logging
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from ..base.checks import extra_module
from ..base.errors import InputError
from ..base.files import make_folder, not_its_fault
from ..base.one_piece import in_one_piece
from ..exchange.listener import Experiment, Signal
from .memory import Batch, writing

TYPES = {"Real": np.float64, "Integer": np.int64, "Boolean": np.uint8, "String": np.uint32}
"""The element type of a channel by its signal's kind."""

TRANSPOSED_DEFLATE: Final = 2
"""The compression of the file; a column's values stand together, so that they compress well."""


def check_mdf() -> None:
    """InputError without asammdf."""
    extra_module("asammdf", "it writes MDF files", "mdf")


class MdfListener:
    """Writes time and signals as one channel group, with units and descriptions.

    A String is recorded as the numbers of its texts, which its channel has as a conversion, so that
    readers show them. The header has the settings of the run: all of them as JSON in its comment,
    and the main ones as properties, with "complete" in addition. The rows are kept until the run
    ends, in whatever way. There is no file where nothing was recorded.
    """

    def __init__(self, path: str | Path, place: Path | None = None) -> None:
        """Written into another `place`, messages name path. InputError without asammdf."""
        check_mdf()
        self._path = Path(path)
        self._place = (place or self._path).absolute()  # an FMU may go elsewhere

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """InputError where there are no signals, or no such folder can be made."""
        if not signals:
            raise InputError(f"{self._path}: nothing to record; must be a system with outputs")
        self._experiment, self._signals, self._batch = experiment, signals, Batch()
        with writing(self._path, InputError):
            make_folder(self._place.parent)

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Keep the rows."""
        self._batch.add(steps, rows)

    def end(self, complete: bool) -> None:
        """Make the file; SimulationError where that fails, and there is none."""
        from asammdf import MDF
        from asammdf import Signal as Channel

        if not self._batch.count:
            return
        steps, rows = self._batch.take()
        times, channels = self._experiment.times(steps), []
        for signal, column in zip(self._signals, rows.T, strict=True):
            value_table: dict[str, Any] = {}
            for number, text in enumerate(signal.texts.listed):
                value_table |= {f"val_{number}": number, f"text_{number}": text}
            samples = column.astype(TYPES["Real" if signal.wide else signal.kind])
            unit = signal.unit or ""
            channels.append(
                Channel(samples, times, unit, signal.name, value_table or None, signal.description)
            )
        # the first version with compressed blocks; every tool of today reads it
        folder = str(self._place.parent)
        with writing(self._path), closing(MDF(version="4.10", temporary_folder=folder)) as mdf:
            mdf.append(channels, comment="", common_timebase=True)
            mdf.header.comment = self._described(complete)
            with in_one_piece(self._place) as part, part.open("wb+") as file:
                mdf.save(file, compression=TRANSPOSED_DEFLATE)

    def _described(self, complete: bool) -> str:
        """The header's comment, in the XML that MDF 4 asks for."""
        root, settings = ElementTree.Element("HDcomment"), self._experiment.settings
        ElementTree.SubElement(root, "TX").text = json.dumps(settings)
        properties = ElementTree.SubElement(root, "common_properties")
        for name, value in {**settings, "complete": complete}.items():
            if not isinstance(value, dict | list):
                ElementTree.SubElement(properties, "e", name=name).text = json.dumps(value)
        return ElementTree.tostring(root, encoding="unicode")


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
            channels = [channel for channel in mdf.iter_channels() if len(channel.samples)]
    except Exception as error:  # of a damaged file it raises whatever it stumbles over
        if limit := not_its_fault(error):
            raise InputError(f"{path}: cannot be read: {limit}") from error
        message = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"{path}: is damaged, not an MDF file: {message}") from error
    if not channels:
        raise InputError(f"{path}: no channel has samples; must be a recorded log")
    time, columns, units = channels[0].timestamps, {}, {}
    for channel in channels:
        if channel.samples.shape == time.shape and channel.samples.dtype.kind in "fiub":
            columns[channel.name], units[channel.name] = (
                channel.samples.astype(np.float64),
                str(channel.unit),
            )
    return time, columns, units
