"""The paper's tables and figures run again, and its claims about them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...base.files import check_folder, write_json, write_text
from ...base.progress import Progress
from ...recording.result import UNITS
from ...report.plot import new_figure
from ..metrics import METRICS
from ..presets import with_preset
from ..system import grasp_system
from .claims import check_claims
from .compared import Evidence, compared
from .page import evaluation_html
from .tables import Source, table_csv

BOOKKEEPING = ("wall_time", "real_time_factor")
"""What differs from one repetition of a grasp to the next."""


def evaluate(
    *,
    bench: bool = False,
    controller: str = "published",
    out: Path | None = None,
    native: bool | None = None,
    progress: bool = False,
) -> dict[str, Any]:
    """Run Cases 0, 1 and 2 in all settings of the paper's simulations, and compare the figures.

    With `bench` they are those of its experiments, on the bench preset. `controller` and `native`
    are as in grasp_system().

    Returns `rows`, each a published figure beside ours, `rms` of the differences in s, `claims` of
    the paper and if they hold, `runs`, the metrics of each grasp, and `units`. With `out`, a
    folder, this is written there as evaluation.json, the rows as evaluation.csv, and all of it with
    pictures as a page, evaluation.html.

    InputError, before anything runs, where `out` cannot be written to or matplotlib is missing that
    draws the pictures; KeyboardInterrupt at Ctrl-C.
    """
    if out is not None:
        check_folder(out)
        new_figure(1.0, 1.0)
    source: Source = "experiment" if bench else "simulation"
    with Progress("compiling the native FMUs, once for these sources", unit="", shown=progress):
        system = grasp_system(controller, native)
    system = with_preset(system, "bench") if bench else system
    evidence = compared(system, source, os.cpu_count() or 1, progress)
    report = as_report(evidence, source)
    if out is not None:
        write(out, evidence, report, source)
    return report


def write(out: Path, evidence: Evidence, report: Mapping[str, Any], source: Source) -> None:
    """Write the page of a report, and its numbers, into a folder."""
    write_json(out / "evaluation.json", report)
    rows = [{**row, "finger": row["finger"] or "difference"} for row in evidence.rows]
    write_text(out / "evaluation.csv", table_csv(rows))
    write_text(out / "evaluation.html", evaluation_html(evidence, report["claims"], source))


def as_report(evidence: Evidence, source: Source) -> dict[str, Any]:
    """What evaluate() returns; a condition is a position in m, or names the colours."""
    return {
        "rows": evidence.rows,
        "rms": evidence.rms,
        "claims": check_claims(source, evidence),
        "runs": [
            {
                "condition": r.setting.x_m if source == "simulation" else r.setting.label,
                "case": r.case,
                **{k: v for k, v in r.metrics.items() if k not in BOOKKEEPING},
            }
            for r in evidence.runs.values()
        ],
        "units": {
            **{m.name: m.unit for m in METRICS},
            **{name: unit for name, unit in UNITS.items() if name not in BOOKKEEPING},
            **{name: "s" for name, value in evidence.rows[0].items() if isinstance(value, float)},
            "rms": "s",
            "condition": "m",
        },
    }


def verdict(report: Mapping[str, Any]) -> str:
    """The claims and the deviations of a report as lines for a terminal."""
    rms = ", ".join(f"{name.replace('_', ' ')} {v:.3f}" for name, v in report["rms"].items())
    return "\n".join(
        [
            *(f"{'holds' if c['holds'] else 'FAILS'}  {c['text']}" for c in report["claims"]),
            f"root mean square of the differences in s: {rms}",
        ]
    )
