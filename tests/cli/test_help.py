"""The help of every command: one example line, unbroken."""

import click
import pytest
from click.testing import CliRunner
from grasp_cosim.cli.group import cli

CONTEXT = click.Context(cli)
NAMES = cli.list_commands(CONTEXT)


@pytest.mark.parametrize("name", NAMES)
def test_a_command_has_an_example(name: str) -> None:
    command = cli.get_command(CONTEXT, name)
    assert command is not None
    text = CliRunner().invoke(command, ["--help"]).output
    assert "\\b" not in text
    (example,) = [line for line in text.splitlines() if line.strip().startswith("Example: ")]
    assert example.strip().startswith(f"Example: grasp-cosim {name} ")


def test_the_group_lists_every_command() -> None:
    text = CliRunner().invoke(cli, ["--help"]).output
    listed = text.partition("Commands:\n")[2].splitlines()
    assert [line.split()[0] for line in listed if line.startswith("  ") and line[2] != " "] == NAMES
    assert {"run", "evaluate", "identify", "qualify", "sweep", "build", "doctor"} <= set(NAMES)


def test_a_command_that_is_none_is_named() -> None:
    result = CliRunner().invoke(cli, ["rnu"])
    assert result.exit_code == 2
    assert "'rnu': no such command; did you mean run?" in result.output
    assert "`grasp-cosim --help` shows all" in CliRunner().invoke(cli, ["xyz"]).output
