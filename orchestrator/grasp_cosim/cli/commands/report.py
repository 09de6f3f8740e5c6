"""The command report."""

from pathlib import Path

import click

from ...errors import InputError
from ...files import check_folder, of_any_format, remove_parts
from ...recording.load import load_run, run_folder
from ...report.page import write_page
from ...report.timing import TIMING, draw_result
from ..frame import PATH, json_option, say, show, title_option, waiting


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
    run = run_folder(run)
    page = out or run / "report.html"
    with waiting(f"drawing {page}"):
        drawn = _draw(run, page, title)
    size = page.stat().st_size
    written = {"page": str(page), "bytes": size, "pictures": drawn}
    show(as_json, written, "\n".join([f"{page}: {size / 1e6:.1f} MB", *drawn]))
    return 0


def _draw(run: Path, page: Path, title: str) -> list[str]:
    """Write the page of a run; the pictures that were drawn beside it."""
    recorded = load_run(run).titled(title)
    if recorded.wall_time is None:
        say(f"{run}: unfinished, to t = {recorded.time[-1]:.6g} s")
    check_folder(page.parent)
    remove_parts(page.parent, page.name, *of_any_format(recorded.drawing.stem, TIMING))
    scene = recorded.drawing.scene(recorded)
    write_page(recorded, page, scene=scene)
    drawn: list[str] = []
    try:
        drawn += map(str, draw_result(recorded, page.parent))
    except InputError as error:
        say(f"no picture: {error}")
    return drawn
