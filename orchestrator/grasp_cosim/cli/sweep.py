"""The command that simulates each row of a table."""

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from ..base.errors import InputError
from ..base.quantity import Quantity
from ..interface.fmi_types import Value
from ..sweeps.pictures import draw_sweep
from ..sweeps.places import cluster
from ..sweeps.rows import grid, varied
from ..sweeps.sweep import sweep as run_sweep
from ..sweeps.table import as_json as in_json
from ..sweeps.table import as_text, check_format
from .frame import (
    INTERRUPTED,
    NEGATIVE,
    PATH,
    check_outputs,
    chosen_metrics,
    fail,
    is_quiet,
    json_option,
    metrics_option,
    say,
    show,
    waiting,
)
from .options import (
    chosen_system,
    many_runs_option,
    settings_of,
    swap_options,
    system_options,
)

TABLE = Path("sweep.csv")


@click.command()
@click.argument("system", required=False, type=PATH)
@click.option(
    "--vary",
    multiple=True,
    metavar="PLACE=START:END:COUNT",
    help="Vary a value: plant.object_width=0.05:0.07:11, or a list as in "
    "sensor_1.reflectance=0.3,0.57,1.2, in the unit of its variable, or as in "
    "'plant.object_width [mm]=50:70:11'. Several make every combination.",
)
@click.option("--table", type=PATH, help="Take the rows of a table, with a column for each place.")
@system_options
@swap_options
@metrics_option
@many_runs_option
@click.option(
    "-o",
    "--out",
    type=PATH,
    default=TABLE,
    help="Table to write, a .csv or .parquet file, or a folder for it.",
)
@click.option(
    "--workers", type=click.IntRange(1), help="Do so many runs at a time. Default: one per core."
)
@click.option("--scheduler", metavar="ADDRESS", help="Run on a Dask cluster, like tcp://host:8786.")
@click.option("--plot", is_flag=True, help="Draw the metrics over what varies, beside the table.")
@json_option
def sweep(out: Path, scheduler: str | None, plot: bool, as_json: bool, **given: Any) -> int:
    """Run a system for each row of a table.

    It writes a table of the metrics of each run. SYSTEM is a .toml or .ssp file, by default the
    built-in grasp. A sweep of experiment.step alone shows the error against the finest step, and
    its order. Finished runs are kept beside the table until all are done: the same command goes on
    where it was ended.

    \b
    Example: grasp-cosim sweep --vary plant.initial_object_position=0:0.05:11 --case 1 --plot
    Step size: grasp-cosim sweep --vary experiment.step=1e-4,2e-4,4e-4
    """
    if scheduler and given["workers"]:
        raise InputError("--workers: cannot be used with --scheduler, which has its own")
    if bool(given["table"]) == bool(given["vary"]):
        raise InputError("sweep: needs --vary or --table, one of them")
    out = out if out.suffix else out / TABLE
    check_format(out)
    check_outputs(out.parent, plot)
    fixed, _ = settings_of(given)
    pairs: dict[str, list[Value | Quantity]] = {}
    for place, values in map(varied, given["vary"]):
        if place in pairs or place in fixed:
            raise InputError(f"--vary {place}: is given twice; must be given once")
        pairs[place] = values
    rows = given["table"] or grid(pairs)
    system = chosen_system(given)
    try:
        with cluster(scheduler) if scheduler else nullcontext() as executor:
            table = run_sweep(
                system,
                rows,
                metrics=chosen_metrics(given["metric_files"]),
                out=out,
                workers=given["workers"],
                executor=executor,
                native=given["native"],
                progress=not is_quiet(),
            )
    except KeyboardInterrupt:
        said = f"interrupted; finished runs are kept beside {out}, the same command goes on"
        return fail(said, INTERRUPTED)
    if plot:
        picture = out.with_suffix(".png")
        with waiting("drawing"):
            draw_sweep(table, picture)
        say(f"drew {picture}")
    show(as_json, {**in_json(table), "table": str(out)}, f"{as_text(table)}\ntable: {out}")
    return NEGATIVE if len(table.errors) == len(table) else 0
