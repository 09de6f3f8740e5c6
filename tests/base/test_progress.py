"""How far something is: on a terminal, elsewhere, and while nobody counts."""

import gc
import io
import sys
import threading
from types import SimpleNamespace

import pytest
from grasp_cosim.base import progress
from grasp_cosim.base.progress import Progress, write
from tqdm import notebook


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture(params=[io.StringIO, Terminal])
def stream(request):
    """What a test puts in the place of standard error; before it, pytest puts its own there."""
    return request.param()


@pytest.fixture
def at_once(monkeypatch):
    """It shows from the beginning, and each time."""
    monkeypatch.setattr(progress, "EVERY", 0.0)


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize(
    ("named", "said"),
    [
        ({"title": "map", "total": 36, "initial": 11}, "map: 11 of 36 runs"),
        ({"title": "try", "total": 3.0, "unit": "s", "initial": 1.25}, "try: 1.25 of 3.00 s"),
        ({"title": "identify", "unit": "grasp", "initial": 7}, "identify: 7 grasps, 00:00"),
        ({"title": "compiling", "unit": ""}, "compiling, 00:00"),
    ],
)
def test_it_says_what_is_at_work(named, said, stream, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream)
    with Progress(**named, delay=0.0, ticking=False) as bar:
        bar.refresh()
    assert said in stream.getvalue()


def test_what_is_over_at_once_shows_nothing(stream, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(progress, "EVERY", 3600.0)  # where the machine does not stand still
    with Progress("map", 3, delay=3600.0) as bar:
        bar.update(3)
    assert stream.getvalue() == ""


@pytest.mark.usefixtures("at_once")
def test_what_is_not_to_be_shown_is_not(stream, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream)
    with Progress("map", 3, shown=False, delay=0.0) as bar:
        bar.update(3)
        bar.refresh()
    assert stream.getvalue() == ""


def test_what_is_said_meanwhile_stands_above_the_bar(monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := Terminal())
    with Progress("map", 3, delay=0.0, ticking=False) as bar:
        bar.update()
        write("drew map.png")
    lines = [line.rpartition("\r")[2].rstrip() for line in stream.getvalue().split("\n")]
    assert lines[0] == "drew map.png"
    assert lines[1].startswith("map: 1 of 3 runs")
    assert lines[2:] == [""]


@pytest.mark.usefixtures("at_once")
def test_time_is_seen_to_go_by_while_one_run_goes_on(stream, monkeypatch):
    """By another thread, which looks at the clock once in a second."""
    seen = threading.Event()

    class Watched(type(stream)):
        def write(self, text):
            if "map: 0 of 3 runs" in text and "00:01" in text:
                seen.set()
            return super().write(text)

    monkeypatch.setattr(sys, "stderr", Watched())
    with Progress("map", 3, delay=0.0):
        assert seen.wait(60.0)


def test_one_that_an_interruption_kept_from_beginning_ends_without_a_word(monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    bar = Progress.__new__(Progress)
    del bar
    gc.collect()
    assert told == []


@pytest.fixture
def kernel(monkeypatch):
    """A kernel of Jupyter without ipywidgets."""
    shell = SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setattr(progress, "find_spec", lambda _: None)


@pytest.mark.usefixtures("kernel")
def test_a_notebook_without_widgets_has_a_bar_that_moves(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with Progress("map", 2, delay=0.0, ticking=False) as bar:
        bar.update()
        bar.refresh()
        write("a line")
    drawn = sys.stderr.getvalue()
    assert "\rmap: 1 of 2 runs ############ " in drawn
    assert "\ra line\n\rmap: 1 of 2 runs" in drawn


@pytest.mark.usefixtures("kernel")
def test_a_notebook_with_widgets_has_one(monkeypatch):
    monkeypatch.setattr(progress, "find_spec", lambda name: name == "ipywidgets")
    children = [
        SimpleNamespace(value=None, style=SimpleNamespace(), bar_style="") for _ in range(3)
    ]
    box = SimpleNamespace(children=children, close=list)
    shown = []
    monkeypatch.setattr(notebook.tqdm_notebook, "status_printer", lambda *_: box)
    monkeypatch.setattr(notebook, "display", shown.append, raising=False)
    with Progress("map", 2, delay=0.0, ticking=False) as bar:
        bar.update()
        bar.refresh()
        left, middle, _ = (child.value for child in children)
    assert shown == [box]
    assert (left.split(), middle) == (["map:", "1", "of", "2", "runs"], 1)
