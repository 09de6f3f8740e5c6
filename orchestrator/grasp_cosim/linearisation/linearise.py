"""A system as the linear model of one macro step, by finite differences over saved states.

Each state and each input of the step is moved a little either way, and the step is done. The change
at its end is a column of the model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..base.errors import InputError, nearest
from ..interface.variables import Variable
from ..master.session import Session
from ..system.description import System, as_system
from ..system.parts import Port, as_port, as_signal
from ..system.times import TimeInput, in_nanoseconds, in_seconds, seconds, written
from ..system.validity import transforms
from .macro_step import Cut, MacroStep, differences
from .state_space import StateSpace, reaching

FAULTS_WITH_STATES = ("delay", "dropout")
"""The kinds of faults that keep values from step to step."""


def linearise(
    system: System | str | Path,
    at: TimeInput,
    inputs: str | Sequence[str] = (),
    outputs: str | Sequence[str] | None = None,
    *,
    step: TimeInput | None = None,
    scheme: str | None = None,
) -> StateSpace:
    """Make the linear model of a system about a moment of its run, of one macro step.

    Each state and each input is moved a little either way. States that reach no output are left
    out.

    Args:
        system: The system, or the path of a system file, .toml or .ssp.
        at: The moment in s: a communication point at which all components meet.
        inputs: Names like "plant.force[1]". An input without a connection, or a tunable parameter,
            is moved as it is. At an input with a connection the loop is opened.
        outputs: Names of outputs; None for all of the components. y[k] is what the run has at point
            k. At an input where the loop is opened, y[k] is the value that the connection would
            bring in step k. The same holds for the output that is connected to it: with u = y the
            loop is closed again.
        step: The communication step in s, in place of that of the system.
        scheme: "sequential" or "jacobi", in place of that of the system.

    Returns:
        The model.

    Raises:
        InputError: There is no such input, output or moment; or the states of an FMU are not known
            one by one, as those of blocks are.
        SimulationError: The run fails.

    Example:
        >>> from grasp_cosim import grasp_system, linearise
        >>> model = linearise(
        ...     grasp_system(), 0.2, ["plant.force[1]"], ["plant.position[1]"], step=1e-3
        ... )
        >>> model.A.shape[0] == len(model.states)
        True
    """
    system = as_system(system, "linearise").with_experiment(step=step, scheme=scheme)
    for i, fault in enumerate(system.faults):
        if fault.kind in FAULTS_WITH_STATES:
            raise InputError(
                f"{system.name}: faults[{i}]: {fault.kind}: has states that are not in the model; "
                "must be of another kind, or left out"
            )
    first_step, steps = _steps_of(system, at)
    ports = [_input(system, name) for name in _names(inputs)]
    output_names = [*map(str, system.watched)] if outputs is None else _names(outputs)
    sources = {connection.target: connection.source for connection in system.connections}
    cuts = {port: Cut() for port in ports if port in sources}
    recorded = [name for name in output_names if as_signal("output", name) not in cuts]
    with Session(system.untriggered().with_record(*recorded), cuts=cuts) as session:
        if first_step:
            session.step(first_step)
        time = session.time
        passed = system.once(transforms)
        cut_outputs = {sources[port]: (cut, passed[port]) for port, cut in cuts.items()}
        macro_step = MacroStep(session, steps, ports, output_names, cuts, cut_outputs)
        a, b, c, d = differences(macro_step)
    observable = reaching(a, c)
    return StateSpace(
        a[np.ix_(observable, observable)],
        b[observable],
        c[:, observable],
        d,
        in_seconds(steps * system.step_ns),
        time,
        tuple(macro_step.states[i] for i in observable),
        tuple(map(str, ports)),
        tuple(output_names),
    )


def _names(names: str | Sequence[str]) -> list[str]:
    """The names of several, or a single one."""
    return [names] if isinstance(names, str) else [*names]


def _steps_of(system: System, at: TimeInput) -> tuple[int, int]:
    """The number of the communication point at a time in s, and the base steps of a macro step."""
    steps = math.lcm(*(system.period(component.name) for component in system.components))
    macro_step_ns = steps * system.step_ns
    time = in_nanoseconds("at", at, zero=True)
    since_start = time - system.start_ns
    latest = system.stop_ns - system.start_ns - macro_step_ns
    if since_start % macro_step_ns or not 0 <= since_start <= latest:
        raise InputError(
            f"at = {written(time)} s: must be a whole number of steps of {seconds(macro_step_ns)} "
            f"after {seconds(system.start_ns)}, and one before {seconds(system.stop_ns)}"
        )
    return int(since_start // system.step_ns), steps


def _input(system: System, name: str) -> Port:
    """The Real input or tunable parameter of a name; InputError where there is none."""
    port = as_port("input", name)
    component = system.component(port.component, f"input {name!r}")
    valid = {v.name for v in component.interface.variables if _can_be_moved(v)}
    if port.variable not in valid:
        raise InputError(
            f"input {name!r}: no input, or tunable parameter, that is a Real; "
            f"{nearest(port.variable, sorted(valid))}"
        )
    return port


def _can_be_moved(variable: Variable) -> bool:
    """True for a Real that a session may set, or at which a loop can be opened."""
    is_settable = variable.causality == "input" or variable.variability == "tunable"
    return variable.kind == "Real" and is_settable
