"""The command report."""

from pathlib import Path

import click

from ...report.page import write_report
from ..frame import PATH, json_option, show, title_option, waiting


@click.command()
@click.argument("run", type=PATH)
@click.option("-o", "--out", type=PATH, help="Page to write. Default: RUN/report.html")
@title_option
@json_option
def report(run: Path, out: Path | None, title: str, as_json: bool) -> int:
    """Make a page of RUN, a folder that `run --out` wrote.

    The page is one file that needs nothing else, with traces, metrics, connections and settings.
    Where matplotlib is installed, the extra plot, a picture is drawn beside it, and a second one of
    the timing of a run in real time.

    \b
    Example: grasp-cosim report results
    """
    with waiting(f"drawing {out or run / 'report.html'}"):
        page, *drawn = write_report(run, out, title)
    size, pictures = page.stat().st_size, [str(picture) for picture in drawn]
    written = {"page": str(page), "bytes": size, "pictures": pictures}
    show(as_json, written, "\n".join([f"{page}: {size / 1e6:.1f} MB", *pictures]))
    return 0
