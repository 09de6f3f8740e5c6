"""The group of the commands, each imported when it is asked for."""

from importlib import import_module
from importlib.resources import files
from importlib.util import find_spec
from tempfile import gettempdir

import click

from .. import interruption
from ..early import begin
from ..scratch import sweep

OF_THE_GRASP = {"evaluate", "identify", "play", "tune"}
"""The commands that there are with the room grasp/ only."""


class Commands(click.Group):
    """The commands in the folder commands/, by the names of their files."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names of all commands."""
        found = [file.name for file in files(f"{__package__}.commands").iterdir()]
        names = {n.removesuffix(".py") for n in found if n.endswith(".py") and n[0] != "_"}
        return sorted(names if find_spec("..grasp", __package__) else names - OF_THE_GRASP)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """The command of that name; None where there is none."""
        if name not in self.list_commands(ctx):
            return None
        command: click.Command = getattr(import_module(f"{__package__}.commands.{name}"), name)
        return command


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="grasp-cosim")
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(debug: bool) -> None:
    """FMI co-simulation of a delicate grasp.

    grasp-cosim COMMAND --help shows the options of a command and an example.
    """
    if begin():
        interruption.command()
    sweep(gettempdir())
