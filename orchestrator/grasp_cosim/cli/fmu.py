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
@click.option("--load", is_flag=True, help="Try whether it loads, in a process of its own.")
@json_option
def inspect(fmu: Path, load: bool, as_json: bool) -> int:
    """Show the interface of any FMU, and whether it loads here.

    The command prints the capabilities and the variables, with units, ranges and dependencies. It
    says whether this machine loads the FMU, as far as the file tells, why not, and the fix. None of
    the FMU's code runs, unless --load tries. The exit code is 1 where it does not load.

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
