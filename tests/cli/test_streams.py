"""Standard files that are closed, full or gone, Ctrl-C before a command begins: one line each."""

import os
import subprocess
import sys

import pytest
from grasp_cosim.cli import main

PROGRAM = (sys.executable, "-m", "grasp_cosim")


def shell(line, **more):
    """Exit code and standard error of the command in a line for sh, where $C is grasp-cosim."""
    done = subprocess.run(
        ["bash", "-c", line], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "C": " ".join(PROGRAM), **more}, check=False, timeout=120,
    )  # fmt: skip
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("$C --version >&-", "Bad file descriptor"),
        ("$C --version >&- <&-", "Bad file descriptor"),
        ("$C --version > /dev/full", "No space left on device"),
    ],
)
def test_standard_output_that_cannot_be_written(line, said):
    assert shell(line) == (3, f"grasp-cosim: standard output: {said}\n")


def test_standard_output_that_nobody_reads():
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as pipe:
        done = subprocess.run(
            [*PROGRAM, "--help"], stdout=pipe, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 3
    assert done.stderr == "grasp-cosim: standard output: Broken pipe\n"


@pytest.mark.parametrize("where", ["2>&-", "2> /dev/full", ">&- 2>&-", "<&- >&- 2>&-"])
def test_standard_error_that_cannot_be_written(where):
    assert shell(f"$C inspect nothing.fmu {where}") == (2, "")


def test_what_a_binary_has_printed_is_not_lost_at_the_end():
    code = """
import ctypes
from grasp_cosim.cli.entry import keep_output_for_us, leave
keep_output_for_us()
ctypes.CDLL(None).printf(b"kept in the buffer of C")
print("ours", flush=True)
leave(0)
"""
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "ours\n", "kept in the buffer of C")


@pytest.mark.slow
def test_a_file_of_the_run_is_not_taken_for_standard_output(tmp_path):
    grasp = "$C run --stop 0.001 --step 1e-3 --out"
    code, said = shell(f"{grasp} {tmp_path / 'a'} && {grasp} {tmp_path / 'b'} >&- <&-")
    assert (code, said.count("standard output: Bad file descriptor")) == (3, 1)
    one, two = ((tmp_path / name / "signals.csv").read_bytes() for name in "ab")
    assert one == two


HOSTILE = "n\x1b]0;owned\x07\x1b[2J\r\u202eümf\x9b31m"


def test_no_escape_sequence_reaches_the_terminal(capsys, tmp_path):
    assert main(["inspect", HOSTILE]) == 2
    said = capsys.readouterr().err
    assert said.startswith("grasp-cosim: n\\x1b]0;owned\\x07")
    assert not set(said) & set("\x1b\x07\r\u202e\x9b")
    assert said.count("\n") == 1


def test_a_line_feed_does_not_make_a_second_line(capsys):
    assert main(["inspect", "two\nlines.fmu"]) == 2
    assert capsys.readouterr().err == "grasp-cosim: two\\nlines.fmu: no such FMU file\n"


def test_ascii_is_no_way_around(tmp_path):
    code, said = shell("$C inspect $'a\\x1b]0;b\\xc3\\xbc'", PYTHONIOENCODING="ascii")
    assert (code, "\x1b" in said, "\\x1b]0;b" in said) == (2, False, True)
