"""An environment of gymnasium over a session. Its episodes are runs, reset without loading."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..base.checks import extra_module
from ..base.errors import InputError
from ..interface.values import Given
from ..master.session import Session
from ..master.simulation import simulate
from ..system.connectors import read_at
from ..system.description import System
from ..system.parts import as_signal
from ..system.times import steps_in

Floats = npt.NDArray[np.float64]
Names = Sequence[str] | Mapping[str, tuple[float, float] | None]
"""Names of variables; with a range of each, or None for that which its FMU declares."""

if TYPE_CHECKING:
    from gymnasium import Env
    from gymnasium.spaces import Box
else:
    _PURPOSE = "which the environments of reinforcement learning are made with"
    Env = extra_module("gymnasium", _PURPOSE, "gym").Env
    Box = extra_module("gymnasium.spaces", _PURPOSE, "gym").Box


class Environment(Env[Floats, Floats]):
    """A system, observed and acted on by the names of its variables, in their units.

    Attributes:
        session: The run of the episode, for whatever else is to be known of it.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - as gymnasium has it

    def __init__(
        self,
        system: System,
        observations: Names,
        actions: Names,
        reward: Callable[[Session], float] | str,
        *,
        step: float,
        ends: Callable[[Session], bool] = lambda _: False,
        start: Callable[[np.random.Generator], Mapping[str, Given]] | None = None,
        **options: Any,
    ) -> None:
        """Load the FMUs, which close() frees.

        Args:
            system: The system.
            observations: The names of the variables that are observed; or by name a range (least,
                greatest) in the unit of the variable, None for the one that its FMU declares.
            actions: The names, or ranges by name, of free inputs or tunable parameters. They hold
                the values of an action for a control step.
            reward: The name of a signal; or a function that gets the session after each control
                step and returns a number.
            step: The control step in s, a whole number of the system's own steps.
            ends: Gets the session after each control step and returns True where the episode is
                terminated. It is truncated at the stop time, or where an FMU ends the run.
            start: Gets the seeded generator of the environment and returns the start values of an
                episode; None for those of the system.
            **options: Further arguments of simulate.session().

        Raises:
            InputError: An argument is wrong, or an FMU does not load.
        """
        if not isinstance(reward, str):
            _check_function("reward", reward)
        _check_function("ends", ends)
        if start is not None:
            _check_function("start", start)
        self.session = simulate.session(system, **options)
        try:
            self._steps = steps_in("step", step, self.session.system.step_ns)
            self.observation_space: Any = self._space("observations", observations)
            self.action_space: Any = self._space("actions", actions)
            self._observed_names, self._action_names = tuple(observations), tuple(actions)
            self._observe()  # where a name is none
        except BaseException:
            self.session.close()
            raise
        self._reward = (lambda session: session[reward]) if isinstance(reward, str) else reward
        self._ends, self._draw_start = ends, start

    def _space(self, argument: str, names: Names) -> Box:
        """The box of the ranges of variables; `argument` is what the user calls these names."""
        if isinstance(names, str):
            raise InputError(f"{argument} = {names!r}: must be a list of names, or ranges by name")
        by_name = names if isinstance(names, Mapping) else dict.fromkeys(names)
        ranges = [
            self._declared(name) if limits is None else limits for name, limits in by_name.items()
        ]
        try:
            low, high = np.array(ranges, np.float64).reshape(len(ranges), 2).T
        except ValueError as error:
            raise InputError(f"{argument}: {by_name!r}: must be ranges, like (0.0, 1.0)") from error
        for name, least, greatest in zip(by_name, low, high, strict=True):
            if not least <= greatest:
                raise InputError(
                    f"{argument}: {name!r} = {by_name[name]!r}: must be (least, greatest)"
                )
        return Box(low, high, dtype=np.float64)

    def _declared(self, name: str) -> tuple[float, float]:
        """The least and the greatest value that an FMU declares; infinite where it does not."""
        system = self.session.system
        port, conversion = read_at(system, as_signal(f"signal {name!r}", name))
        variable = system.component(port.component, name).interface.by_name.get(port.variable)
        if variable is None:
            return -inf, inf
        limits = conversion(variable.low), conversion(variable.high)
        return min(limits), max(limits)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Seeds the generator of the environment; None goes on with it.
            options: Start values by name, which go before those that `start` draws.

        Returns:
            The observation of the shape (observations,), and nothing else that is known.

        Raises:
            InputError: A start value does not fit.
            SimulationError: An FMU fails.
        """
        super().reset(seed=seed)
        drawn = self._draw_start(self.np_random) if self._draw_start else {}
        self.session.reset({**drawn, **(options or {})})
        return self._observe(), {}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Hold an action for a control step.

        Args:
            action: A value for each of the actions, of the shape (actions,).

        Returns:
            The observation, the reward, True if the episode is terminated, True if it is truncated,
            and nothing else that is known.

        Raises:
            InputError: The action has another shape.
            SimulationError: An FMU fails.
        """
        session, values = self.session, np.asarray(action)
        if values.shape != self.action_space.shape:
            raise InputError(f"action = {action!r}: must be an array of {len(self._action_names)}")
        session.set_all(dict(zip(self._action_names, values.tolist(), strict=True)))
        session.step(self._steps)
        is_over = session.complete or session.ended_at is not None
        is_terminated = bool(self._ends(session))
        reward = float(self._reward(session))
        return self._observe(), reward, is_terminated, is_over and not is_terminated, {}

    def _observe(self) -> Floats:
        """The present values of the variables that are observed."""
        session = self.session
        return np.array([session[name] for name in self._observed_names], np.float64)

    def close(self) -> None:
        """Free the FMUs."""
        self.session.close()


def _check_function(argument: str, function: object) -> None:
    """InputError for what is no function."""
    if not callable(function):
        raise InputError(f"{argument} = {function!r}: must be a function")
