"""What is printed: harmless, as much as was asked for, and where it cannot be written, one line."""

import json
import logging
import os
import re
import subprocess
import sys

import pytest
from grasp_cosim.grasp.presets import SYSTEM
from support.native_fmus import needs_gcc
from support.native_systems import driven, write_oscillator


def shell(line, **more):
    """Exit code, standard output and error of a line for bash, where $C is grasp-cosim."""
    done = subprocess.run(
        ["bash", "-c", line], capture_output=True, text=True, check=False, timeout=120,
        env={**os.environ, "C": f"{sys.executable} -m grasp_cosim", **more},
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("$C --version >&-", 3, "standard output: Bad file descriptor"),
        ("$C --version >&- <&-", 3, "standard output: Bad file descriptor"),
        ("$C --version > /dev/full", 3, "standard output: No space left on device"),
        ("(sleep 1; $C --help) | :; exit ${PIPESTATUS[0]}", 3, "standard output: Broken pi"),
        ("$C inspect nothing.fmu 2>&-", 2, ""),
        ("$C inspect nothing.fmu 2> /dev/full", 2, ""),
        ("$C inspect nothing.fmu <&- >&- 2>&-", 2, ""),
    ],
)
def test_a_standard_file_that_cannot_be_written(line, code, said):
    done, out, err = shell(line)
    assert (done, out, err.count("\n")) == (code, "", bool(said))
    assert err.startswith(said and f"grasp-cosim: {said}")


@pytest.mark.slow
def test_a_full_disk_is_no_wrong_input(fmus, tmp_path):
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    (tmp_path / "grasp.toml").write_text(text)
    code, _, err = shell(f"$C run {tmp_path}/grasp.toml --stop 0.001 > /dev/full")
    assert (code, "Traceback" in err) == (3, False)
    assert "No space left on device" in err


@pytest.mark.slow
def test_a_file_of_the_run_is_not_taken_for_standard_output(tmp_path):
    grasp = "$C run --stop 0.001 --step 1e-3 --out"
    code, _, err = shell(f"{grasp} {tmp_path / 'a'} && {grasp} {tmp_path / 'b'} >&- <&-")
    assert (code, err.count("standard output: Bad file descriptor")) == (3, 1)
    one, two = ((tmp_path / name / "signals.csv").read_bytes() for name in "ab")
    assert one == two


@needs_gcc
def test_what_an_fmu_prints_does_not_get_into_the_json(tmp_path):
    path = driven(tmp_path, "time,a.u_Real\n0,0\n")
    code, out, err = shell(f"$C run {path} --input {tmp_path}/drive.csv --json")
    assert code == 0, err
    assert json.loads(out)["steps"] == 10
    assert "native FMU 2.0 instantiated" in err


def test_what_a_binary_has_printed_is_not_lost_at_the_end():
    program = """
import ctypes
from grasp_cosim.cli.entry import keep_output_for_us, leave
keep_output_for_us()
ctypes.CDLL(None).printf(b"kept in the buffer of C")
print("ours", flush=True)
leave(0)
"""
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "ours\n", "kept in the buffer of C")


def test_no_escape_sequence_reaches_the_terminal(command):
    code, _, err = command("inspect", "n\x1b]0;owned\x07\x1b[2J\r\u202eümf\x9b31m\nlines.fmu")
    assert code == 2
    assert err.startswith("grasp-cosim: n\\x1b]0;owned\\x07")
    assert err.endswith("\\nlines.fmu: no such FMU file\n")
    assert not set(err) & set("\x1b\x07\r\u202e\x9b")
    assert err.count("\n") == 1


def test_ascii_is_no_way_around():
    code, _, err = shell("$C inspect $'a\\x1b]0;b\\xc3\\xbc'", PYTHONIOENCODING="ascii")
    assert (code, "\x1b" in err, "\\x1b]0;b" in err) == (2, False, True)


# ------------------------------------------------------------------ as much as was asked for

RUN = ("run", "oscillator.toml", "--stop", "0.5")


@pytest.fixture
def oscillator(command, tmp_path, monkeypatch):
    write_oscillator(tmp_path, "")
    monkeypatch.setattr("grasp_cosim.base.progress.EVERY", 0.0)
    return command


def test_quiet_and_verbose(oscillator):
    usual, quiet, verbose = (oscillator(*RUN, *more) for more in ((), ("-q",), ("--verbose",)))
    assert {usual[0], quiet[0], verbose[0]} == {0}
    assert len({re.sub(r"[\d.]+ times", "", out) for _, out, _ in (usual, quiet, verbose)}) == 1
    assert "oscillator.toml: 0.50 of 0.50 s, 00:00" in usual[2]
    assert quiet[2] == oscillator("-q", *RUN)[2] == ""
    for line in (
        r"a: \S+\.fmu, FMI 2\.0, a binary", r"loading 2 FMUs: \d+\.\d\d s",
        r"engine: the loop in .*", r"oscillator.toml to 0\.5 s: \d+\.\d\d s",
    ):  # fmt: skip
        assert len(re.findall(f"^{line}$", verbose[2], re.MULTILINE)) == 1
    twice = oscillator("--verbose", *RUN, "-v")[2]
    assert twice.count("engine: the loop in ") == 1


@pytest.mark.parametrize("line", ["--debug run --step 0 -q", "run --step 0 --debug"])
def test_errors_stay_and_debug_shows_the_traceback(command, line):
    code, out, err = command(*line.replace("--debug", "").split(), "--quiet")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "Traceback" in command(*line.split())[2]


def test_nothing_is_left_behind(oscillator):
    """A later command in the same process says no more than usual."""
    logger = logging.getLogger("grasp_cosim")
    before = logger.level, [*logger.handlers]
    oscillator(*RUN, "-v")
    assert (logger.level, [*logger.handlers]) == before
    oscillator(*RUN, "-q")
    assert "0.50 of 0.50 s" in oscillator(*RUN)[2]
