"""The help of every command: one example line, unbroken."""

import click
import pytest
from click.testing import CliRunner
from grasp_cosim.cli.entry import COMMANDS
from grasp_cosim.cli.frame import cli


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: c.name)
def test_a_command_has_an_example(command: click.Command) -> None:
    text = CliRunner().invoke(command, ["--help"]).output
    assert "\\b" not in text
    (example,) = [line for line in text.splitlines() if line.strip().startswith("Example: ")]
    assert example.strip().startswith(f"Example: grasp-cosim {command.name} ")


def test_the_group_lists_every_command() -> None:
    text = CliRunner().invoke(cli, ["--help"]).output
    assert "\\b" not in text
    for command in COMMANDS:
        assert f"  grasp-cosim {command.name} " in text
