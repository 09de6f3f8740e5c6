"""How far something is: on a terminal, elsewhere, and how long the rest takes."""

import io
import re
import sys
import threading
from collections.abc import Callable

import pytest
from grasp_cosim.base import progress
from grasp_cosim.base.progress import Progress, span, write


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Clock:
    """Stands in the place of the clocks: advance() is all that makes time go by."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now

    def advance(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    for place in ("time.monotonic", "time.time", "tqdm.std.time"):
        monkeypatch.setattr(place, made)
    return made


@pytest.fixture(params=[io.StringIO, Terminal])
def stream(request: pytest.FixtureRequest) -> io.StringIO:
    """What a test puts in the place of standard error; before it, pytest puts its own there."""
    made: io.StringIO = request.param()
    return made


def still(what: str, total: float | None = None, **more: object) -> Progress:
    """A progress without a thread."""
    return Progress(what, total, ticking=False, **more)  # type: ignore[arg-type]


def test_one_sample_tells_nothing(clock: Clock) -> None:
    """The first run took 40 s to start and to run: 11 more of these would be absurd."""
    with still("map", 12) as bar:
        assert bar.left is None
        clock.advance(40.0)
        bar.update()
        assert bar.left is None
        clock.advance(2.0)
        bar.update()
        assert bar.left == pytest.approx(10 * 2.0)
        clock.advance(1.5)
        assert bar.left == pytest.approx(10 * 2.0 - 1.5)


def test_runs_that_end_together_tell_nothing(clock: Clock) -> None:
    """Two workers: what they began together ends together."""
    with still("map", 20, initial=4) as bar:
        for _ in range(3):
            clock.advance(5.0)
            bar.update()
            clock.advance(0.1)
            bar.update()
            if bar.n == 6:
                assert bar.left is None
        assert bar.left == pytest.approx(10 / 5 * 10.3, rel=0.02)
        clock.advance(1e6)
        assert bar.left == 0.0


def test_nothing_is_told_where_there_is_no_end(clock: Clock) -> None:
    with still("identify", unit="grasp") as bar:
        for _ in range(3):
            clock.advance(5.0)
            bar.update()
        assert bar.left is None


@pytest.mark.parametrize(
    ("update", "said"),
    [
        (lambda: Progress("map", 36, initial=11), "map: run 12 of 36"),
        (lambda: Progress("map", 36, initial=36), "map: run 36 of 36"),
        (lambda: Progress("candidate", 3.0, unit="s", initial=1.25), "candidate: 1.25 of 3.00 s"),
        (lambda: Progress("identify", unit="grasp", initial=7), "identify: 7 grasps"),
    ],
)
def test_it_says_what_is_at_work(
    update: Callable[[], Progress], said: str, stream: io.StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(progress, "DELAY", 0.0)
    monkeypatch.setattr(progress, "EVERY", 0.0)
    with update() as bar:
        bar.refresh()
        assert said in stream.getvalue()


def test_what_is_over_at_once_shows_nothing(
    stream: io.StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(progress, "DELAY", 3600.0)  # where the machine does not stand still
    with Progress("map", 3) as bar:
        bar.update(3)
    assert stream.getvalue() == ""


def test_what_is_not_to_be_shown_is_not(
    stream: io.StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "DELAY", 0.0)
    monkeypatch.setattr(progress, "EVERY", 0.0)
    monkeypatch.setattr(sys, "stderr", stream)
    with Progress("map", 3, shown=False) as bar:
        bar.update(3)
        bar.refresh()
    assert stream.getvalue() == ""


@pytest.mark.usefixtures("clock")
def test_without_a_terminal_there_are_whole_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """One at each update, as the time between two lines is none here."""
    monkeypatch.setattr(sys, "stderr", stream := io.StringIO())
    monkeypatch.setattr(progress, "EVERY", 0.0)
    with still("map", 3) as bar:
        bar.update()
        bar.update()
    lines = stream.getvalue().splitlines()
    assert {"map: run 2 of 3, 0 s", "map: run 3 of 3, 0 s"} <= set(lines)
    assert all(re.fullmatch(r"map: run \d of 3, 0 s", line) for line in lines)


@pytest.mark.usefixtures("clock")
def test_what_is_said_meanwhile_stands_above_the_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", stream := Terminal())
    monkeypatch.setattr(progress, "DELAY", 0.0)
    with still("map", 3) as bar:
        bar.update()
        write("drew map.png")
    lines = [line.rpartition("\r")[2].rstrip() for line in stream.getvalue().split("\n")]
    assert lines[0] == "drew map.png"
    assert re.fullmatch(r"map: run 2 of 3 \S+ +0 s", lines[1])
    assert lines[2:] == [""]


def test_time_is_seen_to_go_by_while_one_run_goes_on(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By another thread, which looks at the clock about once in a second."""
    said, seen = "map: run 1 of 3 ", threading.Event()

    class Watched(Terminal):
        def write(self, text: str) -> int:
            if said in text and "9 s" in text:
                seen.set()
            return super().write(text)

    monkeypatch.setattr(sys, "stderr", Watched())
    with Progress("map", 3):
        clock.advance(9.0)
        assert seen.wait(60.0)


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(0.4, "0 s"), (8.2, "8 s"), (89.0, "89 s"), (100.0, "2 min"), (5e3, "83 min"), (9e3, "2.5 h")],
)
def test_a_time_is_said_as_one_says_it(seconds: float, said: str) -> None:
    assert span(seconds) == said
