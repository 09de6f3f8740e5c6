"""The command evaluate."""

from pathlib import Path

import click

from ...grasp.published.evaluation import evaluate as run_evaluation
from ...grasp.published.evaluation import verdict
from ..frame import NEGATIVE, PATH, is_quiet, json_option, show
from ..options import controller_option, many_runs_option


@click.command()
@click.option("--bench", is_flag=True, help="Take the experiments, with friction and electronics.")
@controller_option
@click.option(
    "-o",
    "--out",
    type=PATH,
    default=Path("results"),
    show_default=True,
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
