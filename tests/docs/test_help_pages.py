"""The messages that the help explains are those that the commands print."""

import re
from pathlib import Path

import pytest
from grasp_cosim import cli
from grasp_cosim.grasp.presets import SYSTEM

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "help/messages.md").read_text("utf-8")
HEADINGS = re.findall(r"^### (.*)$", PAGE, re.MULTILINE)

METRIC = """
from grasp_cosim import metric


@metric("own"{needs})
def own(run):
    return run["{name}"][-1]
"""

COMMANDS = {
    "no such command": ["simulate"],
    "there is no such FMU in": ["run", "missing.toml"],
    "has no input, parameter or initial value": ["run", "--set", "plant.object_widht=0.06"],
    "must be a finite number from": ["run", "--set", "plant.object_width=-1"],
    "must be filled in": ["run", "todo.toml"],
    "no source for": ["run", "open.toml"],
    "which cannot be converted": ["run", "units.toml"],
    "plant lacks": ["run", "--metrics", "needs.py"],
    "a signal that is no output must be recorded": [
        "run",
        "--stop",
        "0.01",
        "--metrics",
        "reads.py",
    ],
    "returned error": ["run", "--step", "0.05", "--set", "controller.contact_force.stiffness=9e5"],
}


@pytest.fixture
def folder(checkout):
    """The current folder, with wrong system files and metrics."""
    text = SYSTEM.read_text("utf-8").replace('fmu = "', 'fmu = "fmus/build/')
    files = {
        "missing.toml": text.replace("GripperPlant.fmu", "Nope.fmu"),
        "todo.toml": text.replace("step = 1e-4", 'step = "TODO: s"'),
        "open.toml": re.sub(r"  .plant.gap\[1\].*\n", "", text),
        "units.toml": text.replace("plant.gap[1] ->", "plant.velocity[1] ->"),
        "needs.py": METRIC.format(needs=", needs=['plant.gapp[1]']", name="plant.gapp[1]"),
        "reads.py": METRIC.format(needs="", name="plant.object_width"),
    }
    for name, content in files.items():
        Path(name).write_text(content, "utf-8")
    return checkout


@pytest.mark.parametrize("words", COMMANDS)
def test_a_message_is_printed_as_the_page_shows_it(words, folder, capsys):
    assert words in HEADINGS
    assert cli.main(COMMANDS[words]) in (2, 3)
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert words in line


LINKS = ("misses in a row", "the peer does not know this session")
"""Messages of a proxy, which tests/hil/ and tests/docs/test_hardware.py have."""

OF_THE_SHELL = "command not found"


def test_each_message_has_a_command_or_is_of_a_proxy_or_of_a_run_that_ended():
    others = {*LINKS, OF_THE_SHELL, "runs away", "did not come to its end", "priority was refused"}
    others.add("never came true: nothing is recorded")  # tests/cli/test_triggered_runs.py has it
    assert {*HEADINGS} == {*COMMANDS, *others}
