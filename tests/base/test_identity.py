"""What decides what a function returns: each thing that may change it, and nothing else."""

import math
import subprocess
import sys
from functools import partial
from types import ModuleType

import numpy as np
import pytest
from grasp_cosim.base.identity import parts_of

TEXT = """
import math
import helpers
LIMITS = {"low": 1.0}
NAMES = {"left", "right", "both"}


class Band:
    width = 2.0

    def inside(self, x):
        return x < self.width


def near(x):
    return Band().inside(x) and x in NAMES


def own(x, most=3.0):
    'What it is.'
    return near(x) or math.sin(x) > LIMITS["low"] + most or helpers.far(x)
"""


@pytest.fixture
def parts(tmp_path, monkeypatch):
    """The parts of own() in a text, and in its module of helpers, with some of it changed."""
    monkeypatch.syspath_prepend(tmp_path)

    def of(old="", new="", helpers="def far(x): return x > 9"):
        assert old in TEXT
        (tmp_path / "helpers.py").write_text(helpers)
        monkeypatch.delitem(sys.modules, "helpers", raising=False)
        names = {"__name__": "users"}
        exec(compile(TEXT.replace(old, new), "users.py", "exec"), names)
        return parts_of(names["own"])

    return of


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("> LIMITS", ">= LIMITS", "code"),
        ("+ most", "+ 2.0 * most", "code"),
        ("most=3.0", "most=4.0", "code"),
        ('"low": 1.0', '"low": 2.0', "LIMITS"),
        ("width = 2.0", "width = 3.0", "near"),
        ("x < self.width", "x <= self.width", "near"),
        ('"both"', '"none"', "near"),
        ("import math", "import cmath as math", "math"),
    ],
)
def test_a_change_shows_in_the_part_that_has_it(parts, old, new, part):
    before, after = parts(), parts(old, new)
    assert [name for name in before if before[name] != after[name]] == [part]


def test_so_does_one_in_a_module_of_the_user(parts):
    before, after = parts(), parts(helpers="def far(x): return x > 8")
    assert [name for name in before if before[name] != after[name]] == ["helpers"]


def test_what_does_not_decide_does_not_show(parts):
    assert parts() == parts("class Band", "# the band\n\n\nUNUSED = 1\nclass Band")


def test_another_process_finds_the_same():
    """In which sets have another order."""
    program = f"""
names = {{"__name__": "__main__"}}
import sys; from types import ModuleType; sys.modules["helpers"] = ModuleType("helpers")
exec({TEXT!r}, names)
from grasp_cosim.base.identity import parts_of
print(parts_of(names["own"]))
"""
    found = {
        subprocess.run(
            [sys.executable, "-c", program], env={"PYTHONHASHSEED": seed, "PATH": ""},
            capture_output=True, text=True, check=True,
        ).stdout
        for seed in "12"
    }  # fmt: skip
    assert len(found) == 1


def test_what_it_closes_over_and_what_it_is_made_of_count():
    def made(limit):
        return lambda x: x < limit

    class Callable:
        def __init__(self, limit):
            self.limit = limit

        def __call__(self, x):
            return x < self.limit

        def method(self, x):
            return x > self.limit

    for make in (
        made,
        Callable,
        lambda limit: Callable(limit).method,
        lambda limit: partial(max, limit),
        lambda limit: made(np.array([0.0, limit])),
        lambda limit: made([math.inf, {"a": limit}]),
    ):
        assert parts_of(make(1.0)) == parts_of(make(1.0)) != parts_of(make(2.0))


def test_what_says_nothing_of_itself_counts_by_its_kind():
    endless = []
    endless.append(endless)

    def own(x):
        return sys.stdout, endless, ModuleType("x")

    assert set(parts_of(own)) == {"code", "sys", "ModuleType", "endless"}
