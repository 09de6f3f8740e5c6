"""The command evaluate."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from ..grasp import grasp_system
from ..published.evaluate import evaluate as run_evaluation
from .frame import NEGATIVE, check_folder, json_option


@click.command()
@click.option("--out", type=click.Path(path_type=Path), default=Path("results"), show_default=True)
@click.option("--workers", type=click.IntRange(1), default=os.cpu_count(), show_default="all cores")
@json_option
def evaluate(out: Path, workers: int, as_json: bool) -> int:
    """Run the published simulation table and figures and compare.

    \b
    Example: grasp-cosim evaluate --out results
    """
    check_folder(out)
    report = run_evaluation(grasp_system(), out, workers, progress=True)
    holds = all(claim["holds"] for claim in report["claims"])
    click.echo(json.dumps(report) if as_json else _verdict(report, out))
    return 0 if holds else NEGATIVE


def _verdict(report: Mapping[str, Any], out: Path) -> str:
    rms = report["rms"]
    return "\n".join(
        [
            *(f"{'holds' if c['holds'] else 'FAILS'}  {c['text']}" for c in report["claims"]),
            f"rms of the contact times {rms['contact_times']:.3f} s, "
            f"at a gap of 0.37 mm {rms['contact_times_at_0.37_mm']:.3f} s",
            f"report: {out / 'report.md'}   pictures: {out / 'contact_forces.png'}, "
            f"{out / 'target_position.png'}, {out / 'contact_times.png'}",
        ]
    )
