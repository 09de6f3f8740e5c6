"""The group of the commands: where each is, imported when it is asked for."""

import logging
import os
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from tempfile import gettempdir

import click

from ..base.collector import without_collector
from ..base.errors import InputError, nearest
from ..base.scratch import sweep
from .frame import EVERYWHERE, logging_at

SECTIONS = {
    "Simulate": {"run": "run", "sweep": "sweep", "evaluate": "paper", "identify": "paper"},
    "Show and compare recorded runs": {"report": "check", "diff": "check", "compare": "check"},
    "Build and check FMUs and systems": {
        "init": "systems", "build": "make", "inspect": "fmu", "qualify": "check",
        "ssp": "systems",
    },
    "Hardware in the loop": {"proxy": "make", "serve": "bench", "relay": "bench"},
}  # fmt: skip
"""Where the help lists a command, and the module that has it; paper.py needs the package grasp/."""

WITH_GRASP = find_spec("..grasp", __package__) is not None

MODULE_OF_COMMAND = {
    command: module
    for modules in SECTIONS.values()
    for command, module in modules.items()
    if WITH_GRASP or module != "paper"
}


class Commands(click.Group):
    """The commands by their MODULE_OF_COMMAND, in SECTIONS."""

    def list_commands(self, _: click.Context) -> list[str]:
        """The names of all commands."""
        return sorted(MODULE_OF_COMMAND)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections of the help, in which each command is once."""
        width = formatter.width - 6 - max(map(len, MODULE_OF_COMMAND))
        for title, names in SECTIONS.items():
            commands = [(n, command) for n in names if (command := self.get_command(ctx, n))]
            with formatter.section(title):
                formatter.write_dl([(n, c.get_short_help_str(width)) for n, c in commands])

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write where the pages are."""
        super().format_epilog(ctx, formatter)
        formatter.write_paragraph()
        formatter.write(f"Documentation: {pages()}\n")

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that the arguments name; UsageError with those nearest to it, where none."""
        if args[0] not in MODULE_OF_COMMAND and not args[0].startswith("-"):
            near = nearest(args[0], sorted(MODULE_OF_COMMAND), "`grasp-cosim --help`")
            ctx.fail(f"{args[0]!r}: no such command; {near}")
        return super().resolve_command(ctx, args)

    def get_command(self, _: click.Context, name: str) -> click.Command | None:
        """The command of that name; None where there is none."""
        if name not in MODULE_OF_COMMAND:
            return None
        with without_collector():
            module = import_module(f"{__package__}.{MODULE_OF_COMMAND[name]}")
        command: click.Command = getattr(module, name)
        command.params += [option for option in EVERYWHERE if option not in command.params]
        return command


def pages() -> Path:
    """The folder of the pages: in the package once it is installed, in the sources next to it."""
    inside = Path(__file__).parents[1] / "docs"
    return inside if inside.is_dir() else Path(__file__).parents[3] / "docs"


HELP_SETTINGS = {"help_option_names": ["-h", "--help"], "show_default": True}


@click.group(cls=Commands, context_settings=HELP_SETTINGS)
@click.version_option(package_name="grasp-cosim")
def cli() -> None:
    """Simulate a delicate grasp as a co-simulation of FMUs.

    Run grasp-cosim COMMAND --help to see the options of a command and an example.
    """
    try:
        os.getcwd()  # noqa: PTH109
    except OSError as error:
        raise InputError("the current folder was removed; go to another one") from error
    click.get_current_context().with_resource(logging_at(logging.WARNING))
    sweep(gettempdir())


cli.params += EVERYWHERE
