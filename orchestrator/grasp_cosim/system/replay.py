"""What a run has recorded, as the stimuli of another system: as it is, be it of outputs or inputs.

A column drives the input or tunable parameter of its name, if that has no other source. An input
that had a connection in the recorded run, and has none here, gets what went through that.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import replace

from ..base.errors import InputError, choices
from .parts import Connection, Port
from .stimuli import Stimuli, Stimulus
from .structure import Structure
from .validity import is_drivable

MAX_NAMED = 3
"""The most columns that the note names."""


def replayed(system: Structure, stimuli: Stimuli) -> tuple[Stimuli, str]:
    """The columns of a recorded run that can drive a system, and a line on these.

    InputError where none can.
    """
    columns = stimuli.recorded_columns
    through = {c.target: c for c in stimuli.recorded or () if c.source in columns}
    driven: dict[Port, Stimulus] = {}
    for port in _undriven_ports(system):
        if port in columns:
            driven[port] = columns[port]
        elif port in through:
            driven[port] = _passed_by_connection(columns[through[port].source], through[port])
    if not driven and not stimuli.partial:
        raise InputError(
            f"{stimuli.file}: is a recorded run, none of whose columns can drive {system.name}; "
            "must have one of an input without a connection, or of a tunable parameter"
        )
    note = (
        f"{stimuli.file}: a recorded run: {choices(driven, MAX_NAMED)} are driven, all else is "
        "left out"
    )
    return replace(stimuli, columns=driven), note


def _undriven_ports(system: Structure) -> Sequence[Port]:
    """The inputs and tunable parameters without a source."""
    sources = {connection.target for connection in system.connections}
    for event in system.events:
        for port in event.set:
            sources |= {*system.elements(port)}
    ports = [
        Port(component.name, v.name)
        for component in system.components
        for v in component.interface.of("input", "parameter")
        if is_drivable(v) and v.is_number
    ]
    return [port for port in ports if port not in sources]


def _passed_by_connection(column: Stimulus, connection: Connection) -> Stimulus:
    """What went through a connection."""
    if connection.factor is None and connection.offset is None:
        return column
    factor = 1.0 if connection.factor is None else connection.factor
    offset = connection.offset or 0.0
    samples = array("d", (factor * sample + offset for sample in column.samples))
    return replace(column, samples=samples, unit=None)
