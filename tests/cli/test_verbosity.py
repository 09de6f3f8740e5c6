"""--quiet and --verbose, which every command has: what is said beside the result."""

import logging
import re
from collections.abc import Callable

import grasp_cosim.cli as cli
import pytest
from support.native_systems import write_oscillator

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    write_oscillator(tmp_path, "")
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        code = cli.main([*arguments])
        out, err = capsys.readouterr()
        return code, out, err

    return run


RUN = ("run", "oscillator.toml", "--stop", "0.5")


def shown(out):
    """What is printed, but for how fast it was."""
    return re.sub(r"[\d.]+ times", "", out)


def test_what_is_said_is_what_was_asked_for(command, monkeypatch):
    monkeypatch.setattr("grasp_cosim.base.progress.EVERY", 0.0)
    usual, quiet, verbose = (command(*RUN, *more) for more in ((), ("-q",), ("--verbose",)))
    assert {usual[0], quiet[0], verbose[0]} == {0}
    assert shown(usual[1]) == shown(quiet[1]) == shown(verbose[1])
    assert "oscillator.toml: 0.50 of 0.50 s, 00:00" in usual[2]
    assert quiet[2] == ""
    said = verbose[2]
    assert re.search(r"^a: \S+\.fmu, FMI 2\.0, a binary$", said, re.MULTILINE)
    assert re.search(r"^loading 2 FMUs: \d+\.\d\d s$", said, re.MULTILINE)
    assert re.search(r"^engine: the loop in ", said, re.MULTILINE)
    assert re.search(r"^oscillator.toml to 0\.5 s: \d+\.\d\d s$", said, re.MULTILINE)


def test_the_options_stand_before_the_command_too(command):
    assert command("-q", *RUN)[2] == ""
    once = command("--verbose", *RUN)[2].splitlines()
    twice = command("--verbose", *RUN, "-v")[2].splitlines()
    assert len(once) == len(twice)
    assert "engine: the loop in " in "\n".join(once)


def test_errors_stay(command):
    code, out, err = command("run", "oscillator.toml", "-q", "--set", "a.x.y=1")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("grasp-cosim: --set a.x.y: ")


def test_notes_are_not_said_when_quiet(command):
    assert command(*RUN, "--out", "out")[0] == 0
    compare = ("compare", "out", "out", "-o", "page.html")
    assert "wrote page.html: " in command(*compare)[2]
    assert command(*compare, "-q")[2] == ""


def test_nothing_is_left_behind(command):
    """A later command in the same process says no more than usual."""
    loggers = [logging.getLogger(name) for name in ("grasp_cosim", "grasp_fmus")]
    before = [(logger.level, [*logger.handlers]) for logger in loggers]
    usual = command(*RUN)[2]
    assert len(command(*RUN, "-v")[2]) > len(usual)
    assert [(logger.level, [*logger.handlers]) for logger in loggers] == before
    assert command(*RUN, "-q")[2] == ""
    assert command(*RUN)[2] == usual
