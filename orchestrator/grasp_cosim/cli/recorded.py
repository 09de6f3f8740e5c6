"""The commands that look at recorded runs: report and compare."""

from pathlib import Path

import click

from ..base.files import check_file
from ..comparison import words
from ..comparison.bands import read_bands
from ..comparison.compare import compare as compare_runs
from ..comparison.page import write_comparison
from ..report.page import write_report
from .frame import (
    NEGATIVE,
    PATH,
    chosen_metrics,
    json_option,
    metrics_option,
    say,
    show,
    waiting,
)


@click.command()
@click.argument("run", type=PATH)
@click.option("-o", "--out", type=PATH, help="Page to write. Default: RUN/report.html")
@click.option(
    "--title", default="", help="Title of the page. Default: system, case and controller."
)
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


@click.command()
@click.argument("a", type=PATH)
@click.argument("b", type=PATH)
@click.option(
    "-o", "--out", type=PATH, help="Page to write, with one run over the other, like compare.html."
)
@click.option(
    "--bands", type=PATH, help="TOML file with bands, as qualify takes it. Default: derived from A."
)
@metrics_option
@json_option
def compare(
    a: Path,
    b: Path,
    out: Path | None,
    bands: Path | None,
    metric_files: tuple[Path, ...],
    as_json: bool,
) -> int:
    """Compare two recorded runs, or a system and a run.

    It compares signals, metrics and settings, over the time that both have. A and B are folders
    that `run --out` wrote; systems (.toml or .ssp), which run as long as the other one; or files of
    signals from elsewhere: ASAM MDF (.mf4), or CSV with the column time and names like
    plant.gap[1], with a unit in brackets where it is not the usual one: "plant.gap[1] [mm]". The
    exit code is 1 where anything is out of its band, or a run did not come to its end.

    \b
    Example: grasp-cosim compare results_a results_b -o compare.html
    """
    if out:
        check_file(out)
    given, metrics = read_bands(bands) if bands else None, chosen_metrics(metric_files)
    with waiting(f"comparing {a} and {b}"):
        found = compare_runs(a, b, bands=given, metrics=metrics)
        if out:
            write_comparison(found, out)
    if out:
        say(f"wrote {out}: {out.stat().st_size / 1e6:.1f} MB")
    show(as_json, words.as_json(found), words.as_text(found))
    return 0 if found.alike else NEGATIVE
