"""The help: every command once in that of the group; a text for everything and one example each."""

import click
import pytest
from click.testing import CliRunner
from grasp_cosim.cli.group import SECTIONS, cli

CONTEXT = click.Context(cli)
NAMES = cli.list_commands(CONTEXT)


def command(name):
    found = cli.get_command(CONTEXT, name)
    assert found is not None
    return found


@pytest.mark.parametrize("name", NAMES)
def test_a_command_has_an_example(name):
    text = CliRunner().invoke(command(name), ["--help"]).output
    assert "\\b" not in text
    (example,) = [line for line in text.splitlines() if line.strip().startswith("Example: ")]
    assert example.strip().startswith(f"Example: grasp-cosim {name} ")


@pytest.mark.parametrize("name", NAMES)
def test_everything_a_command_takes_has_a_text(name):
    """Click has none for an argument: it stands, in capitals, in the text of the command."""
    made = command(name)
    for parameter in made.params:
        if isinstance(parameter, click.Option):
            assert (parameter.help or "").strip(), parameter.opts
        else:
            assert parameter.make_metavar(CONTEXT).strip("[]") in (made.help or "")


def test_the_group_lists_every_command_once_under_its_heading():
    text = CliRunner().invoke(cli, ["--help"], terminal_width=80).output
    found = {}
    for block in text.partition("Options:\n")[2].split("\n\n")[1:]:
        heading, *lines = block.rstrip("\n").split("\n")
        found[heading.removesuffix(":")] = [line.split()[0] for line in lines]
        assert all(line[2] != " " and not line.endswith("...") for line in lines), "cut or broken"
    assert {h: list(names) for h, names in SECTIONS.items()} == found
    assert sorted(name for names in found.values() for name in names) == NAMES


def test_a_command_that_is_none_is_named():
    result = CliRunner().invoke(cli, ["rnu"])
    assert result.exit_code == 2
    assert "'rnu': no such command; did you mean run?" in result.output
    assert "`grasp-cosim --help` shows all" in CliRunner().invoke(cli, ["xyz"]).output
