"""Does all that a page tells its reader to do, in order, and compares what it shows.

A console block has commands behind "$ ", and below each its output. A line of three dots stands for
any lines. A Python or TOML block whose first line is a comment with a file name is saved as that
file, or appended to it. Other Python blocks run one after the other with the same names, and a text
block that follows one is its output.
"""

import re
import shlex
import subprocess
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

from grasp_cosim import cli
from support.pages import commands_of

NEGATIVE = re.compile(r"^(DIFFERENT|NOT QUALIFIED|FAILS) ?", re.MULTILINE)
"""The lines of outputs that go with exit code 1."""

BLOCK = re.compile(r"^```(console|python|toml|text)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
FILE_NAME = re.compile(r"# ([\w/]+\.(?:py|toml|csv))\b")
APPENDED = re.compile(r"# append to ([\w/]+\.toml)\b")
CHANGING = [
    (re.compile(r"[\d.]+ times as fast as real time"), "N times as fast as real time"),
    (re.compile(r"\d{4}-\d\d-\d\d(T[\d:+]+)?"), "DATE"),
    (re.compile(r"\b\d+\.\d MB"), "N MB"),
]
"""Parts of outputs that differ from run to run."""


def do(page, capsys):
    """Do all that a page shows, in the current folder, which is like that of a checkout."""
    names = {"__name__": "__main__"}
    printed = ""
    for kind, block in BLOCK.findall(page):
        if kind == "console":
            for line, shown in commands_of(block):
                command = line.partition("  #")[0].strip()
                code = 1 if NEGATIVE.search(shown) else 0
                assert_shown(shown, output_of(command, code, capsys), command)
        elif kind == "text":
            assert_shown(block, printed, "the Python block above")
        elif name := APPENDED.match(block):
            with Path(name[1]).open("a", encoding="utf-8") as file:
                file.write(block)
        elif name := FILE_NAME.match(block):
            Path(name[1]).write_text(block, "utf-8")
        elif kind == "python":
            with redirect_stdout(StringIO()) as out:
                exec(compile(block, "page", "exec"), names)
            printed = out.getvalue()


def output_of(command, code, capsys):
    """What a command prints on both streams; it must end with the exit code."""
    words = shlex.split(command)
    if words == ["source", ".venv/bin/activate"]:
        return ""  # the tests run in an environment
    if words[0] == "grasp-cosim":
        capsys.readouterr()
        assert cli.main(words[1:]) == code, command
        streams = capsys.readouterr()
        return streams.out + streams.err
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


def assert_shown(shown, printed, command):
    """Compare what a page shows with what was printed."""
    if not shown.strip():
        return
    expected, found = map(steady, (shown.removesuffix("...\n"), printed))
    pattern = "\n".join(
        ".*?" if line.strip() == "..." else re.escape(line) for line in expected.splitlines()
    )
    assert re.search(f"^{pattern}", found, re.DOTALL | re.MULTILINE), f"{command}\n{printed}"


def steady(text):
    for pattern, instead in CHANGING:
        text = pattern.sub(instead, text)
    return "\n".join(line.rstrip() for line in text.splitlines())
