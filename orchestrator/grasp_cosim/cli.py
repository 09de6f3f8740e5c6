"""The command line, grasp-cosim."""

import json
import os
import shutil
import sys
import tempfile
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import click

from .doctor import as_json as findings_json
from .doctor import as_text as findings_text
from .doctor import examine
from .errors import InputError, SimulationError
from .evaluate import evaluate as run_evaluation
from .grasp import BOUND_FOLDER, CASES, FMU_FOLDER, grasp_system
from .inspection import as_text as inspection_text
from .inspection import inspect_fmu
from .interface import Value
from .plot import check_plot
from .recording import Result
from .simulation import simulate
from .system import SCHEMES, System

NEGATIVE, WRONG, FAILED, INTERRUPTED = 1, 2, 3, 130
"""Exit codes beside 0: result negative, input wrong, failure on the way, Ctrl-C."""

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


def entry() -> NoReturn:
    """The command grasp-cosim."""
    sys.exit(main(sys.argv[1:]))


def main(arguments: list[str]) -> int:
    """Run a command line and return its exit code.

    An error is one line on standard error, without a traceback unless --debug is given.
    """
    debug = "--debug" in arguments
    try:
        return int(cli.main(arguments, "grasp-cosim", standalone_mode=False) or 0)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help(), err=True)
        return WRONG
    except click.ClickException as error:
        return _fail(error.format_message(), WRONG)
    except InputError as error:
        return _fail(str(error), WRONG, debug)
    except OSError as error:
        text = f"{error.filename}: {error.strerror}" if error.filename else str(error)
        return _fail(text, WRONG, debug)
    except SimulationError as error:
        return _fail(str(error), FAILED, debug)
    except (KeyboardInterrupt, click.Abort):
        return _fail("interrupted", INTERRUPTED)
    except Exception as error:
        return _fail(f"{type(error).__name__}: {error} (--debug shows where)", FAILED, debug)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="grasp-cosim")
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(debug: bool) -> None:
    r"""FMI co-simulation of a delicate grasp.

    \b
    grasp-cosim run                  the published grasp, from FMUs
    grasp-cosim evaluate             the published table and figures, side by side with ours
    grasp-cosim build                the FMUs
    grasp-cosim inspect FMU          an FMU's interface
    grasp-cosim doctor FMU           whether this machine will load an FMU
    grasp-cosim COMMAND --help       options and an example
    """


@cli.command()
@click.option("--out", type=click.Path(path_type=Path), help=f"Default: {FMU_FOLDER}")
@click.option(
    "--bind-python",
    is_flag=False,
    flag_value=sys.executable,
    metavar="[PYTHON]",
    help=f"For hosts that are not Python: bind to libpython. Default of --out: {BOUND_FOLDER}",
)
@json_option
def build(out: Path | None, bind_python: str | None, as_json: bool) -> int:
    r"""Build the FMUs: GripperPlant, ProximitySensor, GraspController.

    Says what is not as it was built last. --bind-python adds the libpython of PYTHON, by default
    of this one, to what the FMUs load.

    \b
    Example: grasp-cosim build --out /tmp/fmus
    """
    from grasp_fmus.build import build as build_fmus

    if bind_python == "":
        raise InputError("--bind-python '': must be a Python program, or left out")
    folder = out or (BOUND_FOLDER if bind_python else FMU_FOLDER)
    check_folder(folder)
    try:
        built = build_fmus(folder, bind_python)
    except ValueError as error:
        raise InputError(f"build: {error}") from error
    if as_json:
        report = {str(b.path): {"status": b.status, "changes": list(b.changes)} for b in built}
        click.echo(json.dumps({"fmus": list(report), "built": report}))
    else:
        for b in built:
            click.echo("\n    ".join((f"{b.path}: {b.status}", *b.changes)))
    return 0


@cli.command()
@click.argument("fmu", type=click.Path(path_type=Path))
@json_option
def inspect(fmu: Path, as_json: bool) -> int:
    r"""Show the interface of any FMU: variables, units, ranges, dependencies, capabilities.

    \b
    Example: grasp-cosim inspect fmus/build/GripperPlant.fmu
    """
    report = inspect_fmu(fmu)
    if as_json:
        click.echo(json.dumps(report))
    else:
        width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
        click.echo(inspection_text(report, width))
    return 0


@cli.command()
@click.argument("fmu", required=False, type=click.Path(path_type=Path))
@json_option
def doctor(fmu: Path | None, as_json: bool) -> int:
    r"""Find out whether this machine will load FMU, and what to do if not.

    Without FMU: whether it will load Python FMUs at all.

    \b
    Example: grasp-cosim doctor vendor.fmu
    """
    findings = examine(fmu)
    if as_json:
        click.echo(json.dumps({"findings": findings_json(findings)}))
    else:
        click.echo(findings_text(findings))
    return NEGATIVE if any(f.status == "problem" for f in findings) else 0


@cli.command()
@click.argument("system", required=False, type=click.Path(path_type=Path))
@click.option("--case", type=click.IntRange(0, 2), help="0 and 1: without layers 3 and 2, 3.")
@click.option("--set", "settings", multiple=True, metavar="COMPONENT.VARIABLE=VALUE")
@click.option("--swap", "swaps", multiple=True, metavar="COMPONENT=FMU")
@click.option("--step", type=float, help="Communication step in s.")
@click.option("--stop", type=float, help="Stop time in s.")
@click.option("--scheme", type=click.Choice(SCHEMES))
@click.option("--out", type=click.Path(path_type=Path), help="Folder for signals.csv and run.json.")
@click.option("--plot", is_flag=True, help="Draw grasp.png, in --out or the current folder.")
@json_option
def run(
    system: Path | None,
    case: int | None,
    settings: tuple[str, ...],
    swaps: tuple[str, ...],
    step: float | None,
    stop: float | None,
    scheme: str | None,
    out: Path | None,
    plot: bool,
    as_json: bool,
) -> int:
    r"""Run SYSTEM, a .toml file; by default the built-in grasp.

    \b
    Example: grasp-cosim run --case 1 --set plant.initial_object_position=0.02 --out results --plot
    """
    chosen = System.load(system) if system else grasp_system()
    fmus = dict(_pair("--swap", text, "COMPONENT=FMU") for text in swaps)
    values: dict[str, Value] = {} if case is None else dict(CASES[case])
    values.update(_pair("--set", text, "COMPONENT.VARIABLE=VALUE") for text in settings)
    chosen = chosen.revised(fmus, values, ("--swap", "--set")).with_experiment(step, stop, scheme)
    if plot:
        check_plot(
            f"{c.name}.{v.name}" for c in chosen.components for v in c.interface.of("output")
        )
    if out or plot:
        check_folder(out or Path())
    try:
        result = simulate(chosen, progress=True)
    except SimulationError as error:
        if error.result:
            _write(error.result, out, plot)
        raise
    _write(result, out, plot)
    click.echo(json.dumps(dict(result.metrics)) if as_json else _summary(result))
    if not result.complete:
        message = f"interrupted at t = {result.time[-1]:.6g} s; kept what was recorded"
        return _fail(message, INTERRUPTED)
    return 0


@cli.command()
@click.option("--out", type=click.Path(path_type=Path), default=Path("results"), show_default=True)
@click.option("--workers", type=click.IntRange(1), default=os.cpu_count(), show_default="all cores")
@json_option
def evaluate(out: Path, workers: int, as_json: bool) -> int:
    r"""Run the published simulation table and figures and compare.

    \b
    Example: grasp-cosim evaluate --out results
    """
    check_folder(out)
    report = run_evaluation(grasp_system(), out, workers, progress=True)
    holds = all(claim["holds"] for claim in report["claims"])
    click.echo(json.dumps(report) if as_json else _verdict(report, out))
    return 0 if holds else NEGATIVE


def check_folder(folder: Path) -> None:
    """InputError where files could not be written to the folder, which need not exist."""
    nearest = folder.absolute()
    while not nearest.exists():
        nearest = nearest.parent
    try:
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise InputError(f"--out {folder}: cannot write to {nearest}: {error.strerror}") from error


def _pair(option: str, text: str, form: str) -> tuple[str, str]:
    left, equals, right = text.partition("=")
    if not (left and equals and right):
        raise InputError(f"{option} {text!r}: must be {form}")
    return left, right


def _write(result: Result, out: Path | None, plot: bool) -> None:
    if out:
        result.to_csv(out / "signals.csv")
        result.to_json(out / "run.json")
    if plot:
        path = (out or Path()) / "grasp.png"
        result.plot(path)
        click.echo(f"drew {path}", err=True)


def _summary(result: Result) -> str:
    m = result.metrics
    lines = [
        f"{m['steps']} steps of {1e3 * m['step']:g} ms, {m['scheme']}, "
        f"{m['real_time_factor']:.2f} times as fast as real time"
    ]
    if "time_to_contact" in m:
        lines += [
            f"{label:22s}{_numbers(m[key], factor)} {unit}"
            for label, key, factor, unit in (
                ("time to contact", "time_to_contact", 1.0, "s"),
                ("time difference", "time_difference", 1.0, "s"),
                ("impact velocity", "impact_velocity", 1e3, "mm/s"),
                ("peak contact force", "peak_contact_force", 1.0, "N"),
                ("steady contact force", "steady_contact_force", 1.0, "N"),
                ("target position", "target_position", 1e3, "mm"),
                ("object shift", "object_shift", 1e3, "mm"),
            )
        ]
    return "\n".join(lines)


def _numbers(value: Any, factor: float) -> str:
    values = value if isinstance(value, list) else [value]
    return "  ".join("    none" if v is None else f"{factor * v:8.3f}" for v in values)


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


def _fail(message: str, code: int, debug: bool = False) -> int:
    if debug:
        traceback.print_exc()
    click.echo(f"grasp-cosim: {message}", err=True)
    return code
