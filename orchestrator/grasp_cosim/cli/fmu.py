"""The command that looks into an FMU."""

import shutil
import sys
from dataclasses import asdict
from pathlib import Path

import click

from ..base.collector import without_collector
from ..inspection import loading
from ..inspection.declarations import declarations_text, inspect_fmu
from .frame import NEGATIVE, PATH, json_option, show, waiting


@click.command()
@click.argument("fmu", type=PATH)
@click.option("--load", is_flag=True, help="Load the FMU in a separate process, as a test.")
@json_option
def inspect(fmu: Path, load: bool, as_json: bool) -> int:
    """Show the interface of an FMU, and check whether it loads here.

    The command prints the capabilities and the variables of FMU, with units, ranges and
    dependencies. If this machine cannot load FMU, the command prints the reason and the remedy. No
    code of FMU runs, except with --load. The exit code is 1 if FMU does not load.

    \b
    Example: grasp-cosim inspect vendor.fmu --load
    """
    with without_collector():
        report = inspect_fmu(fmu)
        with waiting(f"examining {fmu}"):
            findings = loading.examine(fmu, load)
        text = ""
        if not as_json:
            width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
            text = f"{declarations_text(report, width)}\n\n{loading.findings_text(findings, load)}"
        verdict = {"loads": loading.loads(findings), "findings": [asdict(f) for f in findings]}
        show(as_json, report | verdict, text)
    return 0 if verdict["loads"] else NEGATIVE
