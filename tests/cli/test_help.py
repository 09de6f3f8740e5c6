"""The help of every command: one example line, unbroken."""

import pytest
from click.testing import CliRunner
from grasp_cosim.cli.entry import cli


@pytest.mark.parametrize("name", sorted(cli.commands))
def test_a_command_has_an_example(name: str) -> None:
    text = CliRunner().invoke(cli, [name, "--help"]).output
    assert "\\b" not in text
    (example,) = [line for line in text.splitlines() if line.strip().startswith("Example: ")]
    assert example.strip().startswith(f"Example: grasp-cosim {name} ") or name == "build"


def test_the_group_lists_every_command() -> None:
    text = CliRunner().invoke(cli, ["--help"]).output
    assert "\\b" not in text
    for name in cli.commands:
        assert f"  grasp-cosim {name} " in text
