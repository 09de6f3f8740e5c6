"""The examples in the docstrings of all public names run, and print what they show."""

import doctest

import grasp_cosim
import pytest
from support.marks import needs_compiler

SLOW = {"evaluate", "identify"}
"""Their examples take many seconds."""

OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@needs_compiler
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in grasp_cosim.__all__],
)
def test_an_example_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    thing = getattr(grasp_cosim, name)
    (test,) = doctest.DocTestFinder(recurse=False).find(thing, name, globs={})
    assert test.examples, "has no example"
    runner = doctest.DocTestRunner(optionflags=OPTIONS)
    printed = []
    runner.run(test, out=printed.append)
    assert runner.failures == 0, "".join(printed)
