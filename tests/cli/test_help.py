"""The help, its commands, and what the shell completes."""

import os
import re
import subprocess
import sys

import click
import pytest
from click.testing import CliRunner
from grasp_cosim.cli.group import cli, pages

CONTEXT = click.Context(cli)
NAMES = cli.list_commands(CONTEXT)


@pytest.mark.parametrize("name", NAMES)
def test_a_command_has_an_example_and_a_text_for_all_it_takes(name):
    """Click has none for an argument: it stands, in capitals, in the text of the command."""
    made = cli.get_command(CONTEXT, name)
    text = CliRunner().invoke(made, ["--help"]).output
    assert "\\b" not in text
    (example,) = re.findall(r"^ *Example: (.*)", text, re.MULTILINE)
    assert example.startswith(f"grasp-cosim {name} ")
    for parameter in made.params:
        if isinstance(parameter, click.Option):
            assert (parameter.help or "").strip(), parameter.opts
        else:
            assert parameter.make_metavar(CONTEXT).strip("[]") in (made.help or "")


def test_the_group_lists_every_command_once(snapshot):
    text = CliRunner().invoke(cli, ["--help"], terminal_width=80).output
    assert text.replace(str(pages()), "PAGES") == snapshot
    assert (pages() / "how_to/foreign_fmu.md").is_file()


def test_no_command_and_one_that_is_none(command):
    code, out, err = command()
    assert (code, out) == (2, "")
    assert "Usage: grasp-cosim" in err
    assert "'rnu': no such command; did you mean run?" in command("rnu")[2]
    code, out, err = command("xyz")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "`grasp-cosim --help` shows all" in err


SOURCE, ASKED = "bash_source", "bash_complete"


@pytest.mark.parametrize(
    ("instruction", "line", "found"),
    [
        (SOURCE, "", "_grasp_cosim_completion"),
        (ASKED, "grasp-cosim r", "plain,relay\nplain,report\nplain,run\n"),
        (ASKED, "grasp-cosim run --scheme j", "plain,jacobi\n"),
    ],
)
def test_what_fits_is_completed(instruction, line, found):
    asks = {"_GRASP_COSIM_COMPLETE": instruction, "COMP_WORDS": line}
    done = subprocess.run(
        [sys.executable, "-P", "-m", "grasp_cosim"],
        env={**os.environ, **asks, "COMP_CWORD": str(line.count(" "))},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert found in done.stdout if instruction == SOURCE else found == done.stdout
