"""The model behind a node: an FMU, or a system of FMUs without one component."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from grasp_cosim import InputError, System, simulate
from grasp_cosim.interface.values import Given
from grasp_cosim.interface.variables import Variable
from grasp_cosim.master.session import Session
from grasp_cosim.system.parts import Component, Port
from grasp_cosim.system.scenario import settable_ports
from grasp_cosim.system.times import Time, in_nanoseconds, in_seconds, steps_in
from grasp_cosim.system.without import start_of

COMPONENT = "fmu"
"""The name of the component of a single FMU."""

ENDLESS = 1e9
"""s, about 32 years: the stop time of a node that has none."""

NEVER = 2**62
"""Every how many steps a row is recorded where no result is asked for."""

FIXED_CAUSALITIES = ("parameter", "structuralParameter")


def single_fmu(path: Path, step: float) -> System:
    """A system of one FMU whose inputs all are free.

    Args:
        path: The FMU.
        step: The communication step in s.

    Raises:
        InputError: The FMU cannot be read, or does not run here.
    """
    inputs = [v for v in Component(COMPONENT, path, {}).interface.of("input") if v.supported]
    values = {variable.name: start_of(variable) for variable in inputs}
    return System(
        path.stem,
        components={COMPONENT: {"fmu": str(path), "values": values}},
        experiment={"step": step, "stop": step},
    )


class Model:
    """A session that begins again at each activation, and exchanges values every period."""

    def __init__(
        self, system: System, period: float | None, stop: float | None, recorded: bool
    ) -> None:
        """Load the FMUs, which close() frees.

        Args:
            system: The system.
            period: The time in s between two exchanges, a whole number of steps; None for a step.
            stop: The stop time in s; None for a run without end.
            recorded: True keeps the rows for a result.

        Raises:
            InputError: An argument is wrong, or an FMU does not load.
        """
        step_ns = system.step_ns
        self._steps = 1 if period is None else steps_in("period", period, step_ns)
        self.period_ns: Time = self._steps * step_ns
        periods = int(in_nanoseconds("stop", ENDLESS if stop is None else stop) // self.period_ns)
        stop_s = in_seconds(system.start_ns + periods * self.period_ns)
        self.session: Session = simulate.session(
            system, stop=stop_s, every=1 if recorded else NEVER
        )
        self._values: dict[str, Given] = {}
        """Start values that differ from those of the system, by name."""
        self.is_begun = False

    @property
    def system(self) -> System:
        """The system as it runs."""
        return self.session.system

    @property
    def time_ns(self) -> Time:
        """The time of the communication point that was reached, in ns."""
        return self.system.time_ns(self.session.master.steps_done)

    def parameters(self, driven: Iterable[str]) -> dict[str, tuple[Variable, bool]]:
        """The parameters, and the inputs that no topic sets, by name; with True what is tunable."""
        settable = self.system.once(settable_ports)
        mapped = {*driven}
        found: dict[str, tuple[Variable, bool]] = {}
        for component in self.system.components:
            for variable in component.interface.of("input", *FIXED_CAUSALITIES):
                port = Port(component.name, variable.name)
                tunable = port in settable
                fixed = variable.causality in FIXED_CAUSALITIES and variable.settable
                if variable.supported and str(port) not in mapped and (tunable or fixed):
                    found[str(port)] = variable, tunable
        return found

    def start(self, name: str, variable: Variable) -> Given:
        """What a parameter starts with."""
        component, _, _ = name.partition(".")
        value: Given = self.system.by_name[component].values.get(variable.name, start_of(variable))
        return value

    def set(self, name: str, value: Given, tunable: bool) -> None:
        """Set a parameter now, if the model has begun, and for each begin from now on.

        Raises:
            InputError: The value does not fit, or the parameter is fixed in a run.
        """
        if self.is_begun and not tunable:
            raise InputError(
                f"{name}: is fixed while the node is active; must be deactivated first"
            )
        if self.is_begun:
            self.session.set(name, value)
        else:
            self.system.with_values({name: value})
        self._values[name] = value

    def begin(self, inputs: Mapping[str, float]) -> None:
        """Initialise the model with these values of its inputs.

        Raises:
            InputError: A value does not fit.
            SimulationError: An FMU fails.
        """
        self.session.reset({**self._values, **inputs})
        self.is_begun = True

    def end(self) -> None:
        """Let fixed parameters be set again."""
        self.is_begun = False

    def advance(self, inputs: Mapping[str, float]) -> bool:
        """Set inputs and do the steps of a period.

        Returns:
            False if the model has come to its end.

        Raises:
            InputError: A value does not fit.
            SimulationError: An FMU fails.
        """
        session = self.session
        session.set_all(inputs)
        session.step(self._steps)
        return not session.complete and session.ended_at is None

    def read(self, names: Iterable[str]) -> dict[str, float]:
        """The present values of variables."""
        session = self.session
        return {name: session[name] for name in names}

    def close(self) -> None:
        """Free the FMUs."""
        self.session.close()
