"""The command report."""

import json
from pathlib import Path

import click

from ...errors import InputError
from ...files import check_folder
from ...recording.load import load_run
from ...report.page import write_page
from ...report.timing import draw_timing
from ..frame import json_option


@click.command()
@click.argument("run", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="The page. Default: RUN/report.html")
@json_option
def report(run: Path, out: Path | None, as_json: bool) -> int:
    """Make a page of RUN, a folder that `run --out` wrote: traces, metrics, connections, settings.

    The page is one file that needs nothing else. A picture is drawn beside it with matplotlib, the
    extra plot, and one more of the timing of a run in real time; without it there is the page
    alone.

    \b
    Example: grasp-cosim report results
    """
    recorded = load_run(run)
    page = out or run / "report.html"
    check_folder(page.parent)
    scene = recorded.drawing.scene(recorded)
    write_page(recorded, run.resolve().name, page, scene=scene)
    picture = page.parent / f"{recorded.drawing.stem}.png"
    pictures = []
    try:
        recorded.plot(picture)
        pictures.append(picture)
        if recorded.timing:
            draw_timing(recorded.timing, float(recorded.time[-1]), page.parent / "timing.png")
            pictures.append(page.parent / "timing.png")
    except InputError as error:
        click.echo(f"no picture: {error}", err=True)
    if as_json:
        written = {"page": str(page), "bytes": page.stat().st_size}
        click.echo(json.dumps({**written, "pictures": [str(p) for p in pictures]}))
    else:
        click.echo(f"{page}: {page.stat().st_size / 1e6:.1f} MB")
        for path in pictures:
            click.echo(path)
    return 0
