"""The group of the commands, each imported when it is asked for."""

import logging
import os
from importlib import import_module
from importlib.resources import files
from importlib.util import find_spec
from tempfile import gettempdir

import click

from ..base.errors import InputError, nearest
from ..base.scratch import sweep
from .frame import EVERYWHERE, told

SECTIONS = {
    "Simulate": ("run", "sweep", "evaluate", "identify"),
    "Look at recorded runs": ("report", "compare"),
    "Make and check FMUs and systems": ("init", "build", "inspect", "qualify", "ssp"),
    "Hardware in the loop": ("proxy", "serve", "relay"),
}
"""Where the help lists a command; one that is in none of these is among the others."""

OF_THE_GRASP = {"evaluate", "identify"}
"""The commands that there are with the room grasp/ only."""


class Commands(click.Group):
    """The commands in the folder commands/, by the names of their files."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names of all commands."""
        found = [file.name for file in files(f"{__package__}.commands").iterdir()]
        names = {n.removesuffix(".py") for n in found if n.endswith(".py") and n[0] != "_"}
        return sorted(names if find_spec("..grasp", __package__) else names - OF_THE_GRASP)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections of the help, in which each command is once."""
        left = self.list_commands(ctx)
        width = formatter.width - 6 - max(map(len, left))
        others = {"Other commands": tuple(sorted(set(left).difference(*SECTIONS.values())))}
        for title, names in (SECTIONS | others).items():
            found = [(n, self.get_command(ctx, n)) for n in names if n in left]
            rows = [(n, command.get_short_help_str(width)) for n, command in found if command]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that the arguments name; UsageError with those nearest to it, where none."""
        if args[0] not in self.list_commands(ctx) and not args[0].startswith("-"):
            near = nearest(args[0], self.list_commands(ctx), "`grasp-cosim --help`")
            ctx.fail(f"{args[0]!r}: no such command; {near}")
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """The command of that name; None where there is none."""
        if name not in self.list_commands(ctx):
            return None
        command: click.Command = getattr(import_module(f"{__package__}.commands.{name}"), name)
        command.params += [option for option in EVERYWHERE if option not in command.params]
        return command


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="grasp-cosim")
def cli() -> None:
    """FMI co-simulation of a delicate grasp.

    grasp-cosim COMMAND --help shows the options of a command and an example.
    """
    try:
        os.getcwd()  # noqa: PTH109
    except OSError as error:
        raise InputError("the current folder was removed; go to another one") from error
    click.get_current_context().with_resource(told(logging.WARNING))
    sweep(gettempdir())


cli.params += EVERYWHERE
