"""Where a run ends, or its loop pauses, and who asked for that."""

from typing import Any

from ..base.errors import SimulationError

NEVER = 2**62
"""A communication point that no run reaches."""


class RunEnd:
    """The last communication point of a run, and the next one at which its loop is to pause."""

    def __init__(self, total_steps: int) -> None:
        self.total_steps = total_steps
        """The number of steps after which the run ends."""
        self.requests: list[str] = []
        """The requests to end the simulation before the stop time, a line each."""
        self.pause = NEVER
        """The number of steps after which the loop is interrupted."""
        self._abort_message = ""

    def ask(self, steps: int, request: str) -> None:
        """Have the run end after so many steps; the request is a line for the log."""
        self.total_steps = steps
        self.requests.append(request)

    def pause_after(self, steps: int) -> None:
        """Have the loop pause after so many steps, or where it is to pause sooner."""
        self.pause = min(self.pause, steps)

    def abort_after(self, steps: int, message: str) -> None:
        """Have the run abort after so many steps, with this message."""
        self._abort_message, self.pause = message, steps

    def go_on(self) -> None:
        """End the pause; SimulationError where the run is to be aborted there."""
        self.pause = NEVER
        if self._abort_message:
            raise SimulationError(self._abort_message)

    def saved(self) -> tuple[Any, ...]:
        """All of it, for restore()."""
        return self.total_steps, [*self.requests], self.pause

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved, before any abort."""
        self.total_steps, requests, self.pause = saved
        self.requests, self._abort_message = [*requests], ""
