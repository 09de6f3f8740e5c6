"""A system as the linear model of one macro step, by finite differences over saved states.

What decides the next step are the states of the FMUs, and the signals that the master holds for a
component that steps before their source. Each is moved a little either way, one macro step is done,
and what has changed is a column of the model.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..base.errors import InputError, nearest
from ..interface.variables import Variable
from ..master.session import Session
from ..system.connectors import read_at
from ..system.description import System, as_system
from ..system.parts import Port, as_port, as_signal
from ..system.times import TimeInput, in_nanoseconds, in_seconds, seconds, written
from ..system.validity import transforms
from .state_space import Matrix, StateSpace, reaching

SHARE = 6e-6
"""By how much of itself a value is moved: the cube root of the rounding of a float, at which what
that and the curvature do to a central difference are equally small.
"""

SMALL = 1e-2
"""What a smaller value counts as there, in its unit."""


WITH_STATES = ("delay", "dropout")
"""Kinds of faults that keep values from step to step."""


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
            k. At an input where the loop is opened, and of the output that is connected to it, y[k]
            is what the connection would bring in step k: with u = y the loop is closed again.
        step: The communication step in s, in place of that of the system.
        scheme: "sequential" or "jacobi", in place of that of the system.

    Returns:
        The model.

    Raises:
        InputError: There is no such input, output or moment; or the states of an FMU are not known
            one by one, as those of blocks are.
        SimulationError: The run fails.
    """
    system = as_system(system, "linearise").with_experiment(step=step, scheme=scheme)
    for i, fault in enumerate(system.faults):
        if fault.kind in WITH_STATES:
            raise InputError(
                f"{system.name}: faults[{i}]: {fault.kind}: has states that are not in the model; "
                "must be of another kind, or left out"
            )
    first, steps = _place(system, at)
    ports = [_input(system, name) for name in _names(inputs)]
    fed = {connection.target: connection.source for connection in system.connections}
    cuts = {port: Cut() for port in ports if port in fed}
    names = [*map(str, system.watched)] if outputs is None else _names(outputs)
    recorded = [name for name in names if as_signal("output", name) not in cuts]
    with Session(system.with_record(*recorded), cuts=cuts) as session:
        if first:
            session.step(first)
        time = session.time
        sources = {fed[port]: (cut, system.once(transforms)[port]) for port, cut in cuts.items()}
        macro_step = MacroStep(session, steps, ports, names, cuts, sources)
        a, b, c, d = differences(macro_step)
    kept = reaching(a, c)
    return StateSpace(
        a[np.ix_(kept, kept)],
        b[kept],
        c[:, kept],
        d,
        in_seconds(steps * system.step_ns),
        time,
        tuple(macro_step.states[i] for i in kept),
        tuple(map(str, ports)),
        tuple(names),
    )


def _names(given: str | Sequence[str]) -> list[str]:
    """The names of several, or a single one."""
    return [given] if isinstance(given, str) else [*given]


def _place(system: System, at: TimeInput) -> tuple[int, int]:
    """The communication point at a time in s, and the base steps of a macro step of all."""
    steps = math.lcm(*(system.period(c.name) for c in system.components))
    every = steps * system.step_ns
    time = in_nanoseconds("at", at, zero=True)
    if (time - system.start_ns) % every or not 0 <= time - system.start_ns <= (
        system.stop_ns - system.start_ns - every
    ):
        raise InputError(
            f"at = {written(time)} s: must be a whole number of steps of {seconds(every)} after "
            f"{seconds(system.start_ns)}, and one before {seconds(system.stop_ns)}"
        )
    return int((time - system.start_ns) // system.step_ns), steps


def _input(system: System, name: str) -> Port:
    """The Real input or tunable parameter of a name; InputError where there is none."""
    port = as_port("input", name)
    component = system.component(port.component, f"input {name!r}")
    valid = {v.name for v in component.interface.variables if _moves(v)}
    if port.variable not in valid:
        raise InputError(
            f"input {name!r}: no input, or tunable parameter, that is a Real; "
            f"{nearest(port.variable, sorted(valid))}"
        )
    return port


def _moves(v: Variable) -> bool:
    return v.kind == "Real" and (v.causality == "input" or v.variability == "tunable")


@dataclass(slots=True)
class Cut:
    """Opens the loop at a connection: notes what that brings, and passes `value` in its place.

    Without a value it passes what it brings.
    """

    brought: float = 0.0
    value: float | None = None

    def __call__(self, brought: float) -> float:
        """What is passed."""
        self.brought = brought
        return brought if self.value is None else self.value


Source = tuple[Cut, tuple[float, float]]
"""Where an output goes to: a cut, and the factor and offset of the connection there."""


class MacroStep:
    """The macro step from a moment of a session on, as a function of x, the states there, and u."""

    def __init__(
        self,
        session: Session,
        steps: int,
        inputs: Sequence[Port],
        outputs: Sequence[str],
        cuts: dict[Port, Cut],
        sources: dict[Port, Source],
    ) -> None:
        """`cuts` are by the input where each is, `sources` by the output that is connected there.

        InputError where there is no such output, or the states of an FMU are not known.
        """
        self._session, self._steps, self._master = session, steps, session.master
        self._begin = session.save()
        self._inputs = [(port, cuts.get(port)) for port in inputs]
        system, slots = session.system, self._master.slots
        self._outputs = [self._reader(name, cuts, sources) for name in outputs]
        held = {connection.source for connection in system.connections}
        held |= {read_at(system, as_signal("output", name))[0] for name in outputs}
        ports = sorted((p for p in held if p in slots), key=lambda port: slots[port])
        self._slots = [slots[port] for port in ports]
        self._numbers = [instance.numbers() for instance in self._master.instances]
        ends = itertools.accumulate(map(len, self._numbers), initial=0)
        self._parts = [slice(*pair) for pair in itertools.pairwise(ends)]
        names = [
            f"{c.name}.state[{i}]"
            for c, numbers in zip(system.components, self._numbers, strict=True)
            for i in range(1, len(numbers) + 1)
        ]
        self.states = [*names, *map(str, ports)]
        """A name for each of x."""
        self.x = self._states()
        session.step(steps)
        self.u = np.array([self._now(port, cut) for port, cut in self._inputs])

    def __call__(self, x: Matrix, u: Matrix) -> tuple[Matrix, Matrix] | None:
        """The states at the end of the step, and the outputs; None where an FMU refuses x."""
        self._session.restore(self._begin)
        for instance, part, numbers in zip(
            self._master.instances, self._parts, self._numbers, strict=True
        ):
            if not np.array_equal(x[part], numbers) and not instance.take_numbers(x[part]):
                return None
        held = x[len(x) - len(self._slots) :]
        self._master.values[self._slots] = held
        for (port, cut), value in zip(self._inputs, u.tolist(), strict=True):
            if cut:
                cut.value = value
            else:
                self._session.set(str(port), value)
        begin = self._master.values.copy()
        self._session.step(self._steps)
        return self._states(), np.array([read(begin) for read in self._outputs])

    def _states(self) -> Matrix:
        numbers = [instance.numbers() for instance in self._master.instances]
        return np.concatenate([*numbers, self._master.values[self._slots]])

    def _now(self, port: Port, cut: Cut | None) -> float:
        """The value of an input in the step that was just done."""
        if cut:
            return cut.brought
        return float(self._master.read(port))

    def _reader(
        self, name: str, cuts: dict[Port, Cut], sources: dict[Port, Source]
    ) -> Callable[[Matrix], float]:
        """What an output is, given the values of the master at the beginning of the step."""
        port, change = read_at(self._session.system, as_signal("output", name))
        if port in cuts:
            return lambda _: cuts[port].brought
        if port in sources:
            cut, (factor, offset) = sources[port]
            return lambda _: change((cut.brought - offset) / factor)
        slots = self._master.slots
        if port not in slots or port in self._master.texts:
            raise InputError(f"output {name!r}: no number of the run; {nearest(name, slots)}")
        return lambda begin: change(float(begin[slots[port]]))


def differences(macro_step: MacroStep) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """A, B, C and D about the x and u of the step; a state that takes no move is held."""
    x, u = macro_step.x, macro_step.u
    a, c = _columns(lambda moved: macro_step(moved, u), x)
    b, d = _columns(lambda moved: macro_step(x, moved), u)
    return a, b, c, d


def _columns(
    function: Callable[[Matrix], tuple[Matrix, Matrix] | None], point: Matrix
) -> tuple[Matrix, Matrix]:
    """The derivatives of both results of a function by each element of its argument."""
    whole = function(point)
    assert whole is not None  # noqa: S101 - it was there
    found = [np.zeros((len(result), len(point))) for result in whole]
    for i, value in enumerate(point.tolist()):
        move = SHARE * max(abs(value), SMALL)
        ends = []
        for moved in (value - move, value + move):
            other = point.copy()
            other[i] = moved
            ends.append(function(other))
        low, high = ends
        if low is None or high is None:
            continue
        distance = (value + move) - (value - move)
        for matrix, before, after in zip(found, low, high, strict=True):
            matrix[:, i] = (after - before) / distance
    return found[0], found[1]
