"""Steps that an FMU rejects: it discards them, or ends them early."""

import numpy as np
import numpy.typing as npt

from ..fmi.instance import DISCARD, EARLY, OK, WARNING, Instance

SMALLEST = 1024
"""A step that is rejected is divided down to this part of it, then the run fails."""


def finish_step(instance: Instance, status: int, begin: float, end: float) -> float | None:
    """Bring an instance to end, in s, that rejected the step from begin to there.

    Goes on from where the step got to. Where it got nowhere, the rest is halved, at most down to
    1/1024 of the step. The time in s where the FMU asked for the end of the simulation, else None.
    SimulationError where that does not help.
    """
    if (ended := instance.the_end()) is not None:
        return ended
    if not instance.interface.can_vary_step:
        raise instance.failure(status, begin)
    clock = np.array([begin])
    smallest = (end - begin) / SMALLEST
    length = end - begin
    for _ in range(2 * SMALLEST):
        reached = instance.last_successful_time()
        if reached is None:
            raise instance.failure(status, float(clock[0]))
        if reached > clock[0]:
            clock[0] = reached
            length = end - float(clock[0])
        elif (length := length / 2) < smallest or clock[0] + length == clock[0]:
            raise instance.failure(status, float(clock[0]))
        status, length = _go_on(instance, clock, end, length, smallest)
        if status <= WARNING:
            return None
        if status not in (DISCARD, EARLY):
            raise instance.failure(status, float(clock[0]))
        if (ended := instance.the_end()) is not None:
            return ended
    raise instance.failure(status, float(clock[0]))


def _go_on(
    instance: Instance,
    clock: npt.NDArray[np.float64],
    end: float,
    length: float,
    smallest: float,
) -> tuple[int, float]:
    """Steps of a length in s from the time in clock[0] to end, or to one that is rejected.

    The last status, and the length of that step. A rest below half of the smallest is none.
    """
    status = OK
    while clock[0] < end and status <= WARNING:
        length = min(length, end - float(clock[0]))
        status = instance.stepper(clock, length).python()
        if status <= WARNING:
            clock[0] = end if clock[0] + length >= end - smallest / 2 else clock[0] + length
    return status, length
