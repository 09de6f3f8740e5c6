"""The commands that repeat the paper: evaluate its tables, identify its friction."""

from collections.abc import Sequence
from pathlib import Path

import click

from ..base.files import check_folder, write_text
from ..grasp.identification.identification import DEFAULT_GROUPS, GROUPS
from ..grasp.identification.identification import identify as run_identification
from ..grasp.published.evaluation import evaluate as run_evaluation
from ..grasp.published.evaluation import verdict
from ..grasp.system import grasp_system
from ..recording.log_names import LogNames
from ..system.overrides import Override
from .frame import NEGATIVE, PATH, is_quiet, json_option, show
from .options import controller_option, many_runs_option, map_option, set_option


@click.command()
@click.option("--bench", is_flag=True, help="Take the experiments, with friction and electronics.")
@controller_option
@click.option(
    "-o",
    "--out",
    type=PATH,
    default=Path("results"),
    help="Folder for the page, evaluation.html, and the numbers.",
)
@many_runs_option
@json_option
def evaluate(
    bench: bool, controller: str | None, out: Path, native: bool | None, as_json: bool
) -> int:
    """Run the published tables and figures again, and compare.

    They are those of the simulations, or with --bench of the experiments. The exit code is 1 where
    a claim of the paper does not hold.

    \b
    Example: grasp-cosim evaluate --out results
    """
    report = run_evaluation(
        bench=bench,
        controller=controller or "published",
        out=out,
        native=native,
        progress=not is_quiet(),
    )
    page = f"to be opened in a browser: {out / 'evaluation.html'}"
    show(as_json, report, f"{verdict(report)}\n{page}")
    return 0 if all(claim["holds"] for claim in report["claims"]) else NEGATIVE


@click.command()
@click.argument("log", type=PATH, required=False)
@click.option(
    "--fit",
    multiple=True,
    default=DEFAULT_GROUPS,
    metavar="|".join(GROUPS),
    help="Fit this; may be given several times.",
)
@map_option
@set_option
@click.option("-o", "--out", type=PATH, help="Folder for the values and the residuals.")
@json_option
def identify(
    log: Path | None,
    fit: tuple[str, ...],
    names: LogNames,
    overrides: Sequence[Override],
    out: Path | None,
    as_json: bool,
) -> int:
    """Fit friction, masses and drives of the fingers to a LOG.

    It is a run or the log of a bench, as a table or .mf4, or a table of contact times, with the
    columns x_m, case, finger, time. Tables are .csv, .arrow or .parquet files. Without LOG it is
    the contact times of the published experiments. What was fitted goes into a run by --values.

    \b
    Example: grasp-cosim identify --fit coulomb --fit viscous --out identified
    From a run: grasp-cosim identify results/signals.csv --fit coulomb
    From a bench: grasp-cosim identify bench.csv --map names.toml --fit mass --fit delay -o fitted
    and with that: grasp-cosim run --preset bench --values fitted/values.toml
    """
    if out:
        check_folder(out)
    system = grasp_system().with_overrides(overrides)
    identification = run_identification(
        log, fit=fit, system=system, progress=not is_quiet(), names=names
    )
    if out:
        for name, text in identification.files().items():
            write_text(out / name, text)
    show(as_json, identification.as_json(), identification.text())
    return 0
