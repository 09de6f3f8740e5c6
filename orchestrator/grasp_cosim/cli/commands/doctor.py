"""The command doctor."""

from dataclasses import asdict
from pathlib import Path

import click

from ...inspection.doctor import as_text, examine
from ..frame import NEGATIVE, PATH, json_option, show, waiting


@click.command()
@click.argument("fmu", required=False, type=PATH)
@json_option
def doctor(fmu: Path | None, as_json: bool) -> int:
    """Find out whether this machine will load FMU.

    If not, it says what to do. Without FMU: whether it will load Python FMUs at all.

    \b
    Example: grasp-cosim doctor vendor.fmu
    """
    with waiting(f"examining {fmu or 'this Python'}"):
        findings = examine(fmu)
    show(as_json, {"findings": [asdict(f) for f in findings]}, as_text(findings))
    return NEGATIVE if any(f.status == "problem" for f in findings) else 0
