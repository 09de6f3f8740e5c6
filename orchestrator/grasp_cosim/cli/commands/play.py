"""The command play."""

from pathlib import Path

import click

from ...files import check_folder
from ..frame import PATH, json_option, show


@click.command()
@click.option("-o", "--out", type=PATH, default="play.html", show_default=True, help="The page.")
@json_option
def play(out: Path, as_json: bool) -> int:
    """Write a page that simulates the grasp in the browser.

    The playground is one file that needs no network and no server: a browser runs the C of the
    native FMUs, as WebAssembly, with the numbers of `run`. Its settings are in its address, and the
    command that does the same is on it.

    \b
    Example: grasp-cosim play -o play.html
    """
    from ...grasp.play.page import write_playground

    check_folder(out.parent)
    write_playground(out)
    size = out.stat().st_size
    show(
        as_json,
        {"page": str(out), "bytes": size},
        f"{out}: {size / 1e6:.2f} MB; to be opened in a browser",
    )
    return 0
