"""The command that simulates each row of a table."""

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from ..base.errors import InputError
from ..base.quantity import Quantity
from ..interface.fmi_types import Value
from ..sweeps.executors import cluster
from ..sweeps.pictures import draw_sweep
from ..sweeps.rows import grid, varied
from ..sweeps.sweep import sweep as run_sweep
from ..sweeps.table import as_json as in_json
from ..sweeps.table import as_text
from ..sweeps.table_files import check_format
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
    SystemOptions,
    chosen_system,
    native_option,
    overrides_of,
    swap_options,
    system_options,
)

TABLE = Path("sweep.csv")


@click.command()
@click.argument("system", required=False, type=PATH)
@click.option(
    "--vary",
    multiple=True,
    metavar="KEY=START:END:COUNT",
    help="Vary a key of the system: plant.object_width=0.05:0.07:11, or a list: "
    "sensor_1.reflectance=0.3,0.57,1.2. The key may have a unit: "
    "'plant.object_width [mm]=50:70:11'. Several --vary make all combinations.",
)
@click.option("--table", type=PATH, help="Table with a row for each run and a column for each key.")
@system_options
@swap_options
@metrics_option
@native_option
@click.option(
    "-o",
    "--out",
    type=PATH,
    default=TABLE,
    help="Table of results, a .csv or .parquet file, or a folder for it.",
)
@click.option(
    "--workers", type=click.IntRange(1), help="Number of runs at a time. Default: one per core."
)
@click.option(
    "--scheduler", metavar="ADDRESS", help="Run on a Dask cluster, such as tcp://10.0.0.1:8786."
)
@click.option(
    "--plot", is_flag=True, help="Draw the metrics over the varied keys, as .png next to the table."
)
@json_option
def sweep(
    vary: tuple[str, ...],
    table: Path | None,
    metric_files: tuple[Path, ...],
    native: bool | None,
    out: Path,
    workers: int | None,
    scheduler: str | None,
    plot: bool,
    as_json: bool,
    **system_options: Any,
) -> int:
    """Run a system for each row of a table.

    SYSTEM is a .toml or .ssp file. The default is the built-in grasp. The command writes a table
    with the metrics of each run. If only experiment.step varies, the command also prints the error
    against the finest step and the order of convergence. If a sweep is interrupted, the same
    command continues it.

    \b
    Example: grasp-cosim sweep --vary plant.initial_object_position=0:0.05:11
    Vary the step: grasp-cosim sweep --vary experiment.step=1e-4,2e-4,4e-4
    """
    if scheduler and workers:
        raise InputError("--workers: cannot be used with --scheduler, which has its own")
    if bool(table) == bool(vary):
        raise InputError("sweep: needs --vary or --table, one of them")
    out = out if out.suffix else out / TABLE
    check_format(out)
    check_outputs(out.parent, plot)
    options = SystemOptions(**system_options)
    fixed = {override.place for override in overrides_of(options)}
    columns: dict[str, list[Value | Quantity]] = {}
    for place, values in map(varied, vary):
        if place in columns or place in fixed:
            raise InputError(f"--vary {place}: is given twice; must be given once")
        columns[place] = values
    system = chosen_system(options)
    try:
        with cluster(scheduler) if scheduler else nullcontext() as executor:
            outcome = run_sweep(
                system,
                table or grid(columns),
                metrics=chosen_metrics(metric_files),
                out=out,
                workers=workers,
                executor=executor,
                native=native,
                progress=not is_quiet(),
            )
    except KeyboardInterrupt:
        message = f"interrupted; finished runs are kept next to {out}; the same command continues"
        return fail(message, INTERRUPTED)
    if plot:
        picture = out.with_suffix(".png")
        with waiting("drawing"):
            draw_sweep(outcome, picture)
        say(f"drew {picture}")
    show(as_json, {**in_json(outcome), "table": str(out)}, f"{as_text(outcome)}\ntable: {out}")
    return NEGATIVE if len(outcome.errors) == len(outcome) else 0
