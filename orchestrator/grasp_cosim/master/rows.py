"""The rows of the steps that are done, which wait here until they are handed on."""

import time
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

Piece = tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]
"""The numbers of steps, and their rows."""


class RowBuffer:
    """Rows of values, one for each step, that the loop fills from the first place on.

    A loop that runs next to the thread which hands the rows on fills the places round and round.
    """

    def __init__(self, width: int, capacity: int) -> None:
        """Rows of so many values, and the places for so many of them."""
        self.rows = np.empty((capacity, width))
        self.rows.fill(0.0)  # its memory is there from now on
        self._origin = 0
        """The step whose successor has the first place."""
        self.handed_on = 0
        """The last step whose row was handed on."""
        self._handed_on_at = time.monotonic()

    @property
    def last_step(self) -> int:
        """The last step for whose row there is a place, unless they are filled round and round."""
        return self._origin + len(self.rows)

    def place(self, step: int) -> int:
        """The place of the row that follows when `step` steps are done."""
        return (step - self._origin) % len(self.rows)

    def waiting(self, steps_done: int) -> npt.NDArray[np.float64]:
        """Rows that wait to be handed on, as far as they are in one piece."""
        first = (self.handed_on - self._origin) % len(self.rows)
        return self.rows[first : first + steps_done - self.handed_on]

    def take(self, steps_done: int) -> Iterator[Piece]:
        """The steps and the rows that wait, in pieces; each counts as handed on as it is given."""
        while len(rows := self.waiting(steps_done)):
            steps = self.handed_on + np.arange(1, len(rows) + 1)
            self.handed_on = int(steps[-1])
            self.note_time()
            yield steps, rows

    def note_time(self) -> None:
        """Take note that rows are handed on now."""
        self._handed_on_at = time.monotonic()

    def seconds_since(self) -> float:
        """The wall time in s since rows were last handed on."""
        return time.monotonic() - self._handed_on_at

    def start_over(self) -> None:
        """Fill the places from the first one on; those that wait are given up."""
        self._origin = self.handed_on

    def saved(self, steps_done: int) -> tuple[int, npt.NDArray[np.float64]]:
        """What was handed on, and the rows that wait, for restore()."""
        return self.handed_on, self.waiting(steps_done).copy()

    def restore(self, saved: tuple[int, npt.NDArray[np.float64]]) -> None:
        """Go back to what was saved."""
        self.handed_on, waiting = saved
        self.start_over()
        self.rows[: len(waiting)] = waiting
