"""A step that did not come to its end at once: rejected, or with events that the master handles.

And which other components fail in a step in which one does.
"""

from collections.abc import Iterator

from ..base.errors import SimulationError
from ..fmi.instance import (
    DISCARD,
    DUE,
    EARLY,
    EVENT,
    WARNING,
    Instance,
    clock_of,
    length_until,
)
from ..system.description import System
from ..system.times import in_seconds
from . import loop
from .plan import Plan

SMALLEST = 1024
"""A step that is rejected is divided down to this part of it, then the run fails."""

TO_BE_FINISHED = (DISCARD, EARLY, EVENT, DUE)
"""The statuses of a step that finish_step() can bring to its end."""


def finish_step(instance: Instance, status: int, begin: float, end: float) -> float | None:
    """Bring an instance to the end of a step that it rejected, or in which it has events.

    Goes on from where the step got to. Where it got nowhere, what remains is halved, at most down
    to 1/1024 of the step; what remains below half of that is nothing.

    Args:
        instance: The instance whose step returned a status of TO_BE_FINISHED.
        status: That status.
        begin: The time in s at which the step began.
        end: The time in s at which it ends.

    Returns:
        The time in s at which the FMU asked for the end of the simulation, or None.

    Raises:
        SimulationError: That does not help, or our FMU refuses a step.
    """
    clock, length = clock_of(begin, end), end - begin
    smallest = length / SMALLEST
    for _ in range(4 * SMALLEST):
        if status in (EVENT, DUE):
            stop = float(clock[0]) + length
            stop = end if stop >= end - smallest / 2 else stop
            status, clock[0] = instance.through_events(status, float(clock[0]), stop)
        if status == DISCARD and instance.interface.ours:
            break  # in Python it could not go on: pythonfmu has no word for it but fatal
        if status in (DISCARD, EARLY):
            if (asked_end := instance.the_end()) is not None:
                return asked_end
            varies = instance.interface.can_vary_step
            if not varies or (reached := instance.last_successful_time()) is None:
                break
            if reached > clock[0]:
                clock[0], length = reached, end - reached
            elif (length := length / 2) < smallest or clock[0] + length == clock[0]:
                break
        elif status > WARNING:
            break
        if clock[0] >= end:
            return None
        length = min(length, length_until(float(clock[0]), end))
        clock[2] = clock[0] + length
        status = instance.stepper(clock, length).python()
        if status <= WARNING:
            clock[0] = end if clock[0] + length >= end - smallest / 2 else clock[0] + length
    raise instance.failure(status, float(clock[0]))


def with_failures_beside(
    error: SimulationError, fatal: bool, plan: Plan, system: System, step: int, operation: int
) -> SimulationError:
    """The error of a component that failed in a step, with those of the others that do so, too.

    In Jacobi's scheme all components step from the same values: those behind the one that failed
    are stepped too, so that one line names all that fail. In the sequential scheme they would
    step from values of the one that failed, and add no message.

    Args:
        error: What the component failed with.
        fatal: True where its status was fatal: then no instance of the same FMU is called again.
        plan: The plan of the loop, whose clock is that of the step.
        system: The system that runs.
        step: The number of the step.
        operation: The number of the operation at which the component failed.
    """
    kind, call, *_ = plan.operations[operation]
    if system.scheme != "jacobi" or kind != loop.STEP:
        return error
    owner = plan.owners[call]
    dead = owner.interface.path if fatal and owner is not None else None
    messages = [str(error), *_failures_behind(plan, system, step, operation, dead)]
    return error if len(messages) == 1 else SimulationError("; ".join(messages))


def _failures_behind(
    plan: Plan, system: System, step: int, operation: int, dead: object
) -> Iterator[str]:
    """Step the components behind an operation; what those that fail say."""
    for kind, call, _, period, phase in plan.operations[operation + 1 :]:
        instance = plan.owners[call] if kind == loop.STEP else None
        if instance is None or step % period != phase or instance.interface.path == dead:
            continue
        begin = in_seconds(system.time_ns(step + 1 - period))
        end = in_seconds(system.time_ns(step + 1))
        plan.clock[0] = begin
        status = plan.calls[call].python()
        try:
            if status == loop.RAISED:
                raise plan.raised.pop()
            if status in TO_BE_FINISHED:
                finish_step(instance, status, begin, end)
            elif status > WARNING:
                raise instance.failure(status, begin)
        except SimulationError as error:
            yield str(error)
