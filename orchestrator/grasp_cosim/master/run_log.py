"""The log of one run: what an engineer should know of it, a line each, and who is told of it."""

from collections.abc import Callable, Iterable, Iterator, Sequence

from ..base.text import counted
from ..system.description import System
from ..system.validity import remarks
from .master import Master
from .run_record import RunRecord


class RunLog:
    """The lines of the log, of which each is told once, as soon as it is known."""

    def __init__(
        self,
        system: System,
        record: RunRecord,
        real_time_remarks: Iterable[str],
        note: Callable[[str], None] | None,
    ) -> None:
        """Take the remarks on a run in real time, and the function that gets each new line."""
        self._record = record
        self._real_time_remarks = tuple(real_time_remarks)
        self._note = note
        self.describe(system)

    @property
    def is_told(self) -> bool:
        """True if somebody gets the lines."""
        return self._note is not None

    def describe(self, system: System) -> None:
        """Begin with what is known of a system. Its notes are known to whoever made the system."""
        self._remarks = (
            *system.notes,
            *self._record.group_notes,
            *system.once(remarks),
            *self._real_time_remarks,
        )
        self._lines_told = len(system.notes)

    def tell_remarks(self) -> None:
        """Tell what is known before the FMUs are loaded."""
        self._tell(self._remarks)

    def tell_start(self, master: Master) -> None:
        """Tell what is known before the first step."""
        self._tell(self._at_start(master))

    def tell_end(self, master: Master, is_over: bool) -> None:
        """Tell all that was not told yet."""
        if self._note is not None:
            self._tell(self.lines(master, is_over))

    def _tell(self, lines: Sequence[str]) -> None:
        """Tell the lines that are new; `lines` is all of the log so far."""
        if self._note is not None:
            for line in lines[self._lines_told :]:
                self._note(line)
        self._lines_told = len(lines)

    def _at_start(self, master: Master) -> tuple[str, ...]:
        """The lines that are known before the first step."""
        return (*self._remarks, *self._record.unit_notes, *master.log)

    def happened(self, master: Master) -> tuple[str, ...]:
        """The lines on what has happened until now; any thread may ask for them."""
        return (*self._record.dispatcher.log, *master.scenario.log, *master.watches.log)

    def lines(self, master: Master, is_over: bool) -> tuple[str, ...]:
        """All lines until now. A run that is over also names what was still to happen in it."""
        pending = [*master.scenario.pending(), *self._record.trigger_log()] if is_over else []
        return (
            *self._at_start(master),
            *self.happened(master),
            *master.warnings(),
            *_rejections(master),
            *master.end.requests,
            *pending,
            *self._record.proxy_log(),
            *self._record.loss_log(),
        )


def _rejections(master: Master) -> Iterator[str]:
    """A line for each component whose FMU rejected steps."""
    for name, rejection in master.rejections.items():
        steps = counted(rejection.count, "step")
        yield (
            f"{name}: {steps} discarded or ended early, taken in parts, "
            f"the first at t = {rejection.first:.9g} s"
        )
