"""The fixed-step master: initialise, then exchange, step, notify.

In the sequential scheme (Gauss-Seidel) a component steps with what the components before it have
just put out, which adds no delay beyond sample and hold. In the Jacobi scheme all components step
with the values of the last communication point. Time is an integer number of nanoseconds.
"""

import ctypes
from collections.abc import Callable, Sequence

from ..errors import InputError, SimulationError, choices
from ..fmi.fmi2 import WARNING, Call
from ..system.description import System
from ..system.parts import NANOSECONDS
from .plan import REAL, Instance, Link, make_plan


class Master:
    """Runs a system's instances. Listeners are called with the step number, from 0 on."""

    def __init__(self, system: System, instances: Sequence[Instance]) -> None:
        self.system = system
        self.total_steps = system.stop_ns // system.step_ns
        self.steps_done = 0
        self.listeners: list[Callable[[int], None]] = []
        self._time = ctypes.c_double(0.0)
        self.plan = make_plan(system, instances, self._time)

    def initialise(self) -> None:
        """Start values in, then outputs at t = 0 that agree with the inputs at t = 0."""
        stop = self.system.stop_ns / NANOSECONDS
        for component, link in zip(self.system.components, self.plan.links, strict=True):
            link.instance.enter_initialization(component.values, stop)
        try:
            self._propagate()
        except SimulationError as error:
            raise InputError(str(error)) from error
        for link in self.plan.links:
            link.instance.exit_initialization()
        for listener in self.listeners:
            listener(0)

    def advance(self, steps: int) -> None:
        """Do the given number of communication steps, or fewer where the stop time is nearer."""
        step = self._sequential if self.system.scheme == "sequential" else self._jacobi
        step_ns = self.system.step_ns
        for done in range(self.steps_done, min(self.steps_done + steps, self.total_steps)):
            self._time.value = done * step_ns / NANOSECONDS
            step()
            self.steps_done = done + 1
            for listener in self.listeners:
                listener(done + 1)

    def _sequential(self) -> None:
        for link in self.plan.links:
            self._move(link)
            self._run(link, link.step)

    def _jacobi(self) -> None:
        for link in self.plan.links:
            self._move(link)
        for link in self.plan.links:
            self._run(link, link.step)

    def _move(self, link: Link) -> None:
        for vector, target, source in link.moves:
            vector[target] = vector[source]

    def _run(self, link: Link, calls: Sequence[Call]) -> None:
        for call in calls:
            if (status := call()) > WARNING:
                raise link.instance.failure(status, self._time.value)

    def _propagate(self) -> None:
        """Pass values along the wires until they stand still, a bounded number of times."""
        moved: list[str] = []
        for link in self.plan.links:
            self._run(link, link.receive)
        for _ in range(len(self.plan.signals) + 2):
            before = self._outputs()
            for link in self.plan.links:
                self._move(link)
                self._run(link, (*link.send, *link.receive))
            moved = [name for name, value in self._outputs().items() if value != before[name]]
            if not moved:
                return
        raise InputError(
            f"{self.system.name}: the values at t = 0 do not settle, an algebraic loop through "
            f"{choices(moved)}; must have a component without direct feedthrough in it"
        )

    def _outputs(self) -> dict[str, bytes]:
        """The bits of all outputs, by name."""
        reals, integers = self.plan.reals, self.plan.integers
        return {
            s.name: (reals[s.slot] if s.kind in REAL else integers[s.slot]).tobytes()
            for s in self.plan.signals
        }
