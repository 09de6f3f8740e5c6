"""The commands that check: qualify an FMU for a place, compare and report runs."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..base.files import check_file
from ..comparison import summary
from ..comparison.bands import read_bands
from ..comparison.changes import diff as changes_between
from ..comparison.compare import compare as compare_runs
from ..comparison.qualify import component_of
from ..comparison.qualify import qualify as run_qualification
from ..interface.read import check_runs
from ..recording.log_names import LogNames
from ..system.description import FILES
from ..system.overrides import SECTIONS, Override, plain
from .frame import (
    NEGATIVE,
    PATH,
    chosen_metrics,
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
    each_once,
    load_system,
    map_option,
    native_option,
    natively,
    preset_option,
    set_option,
    step_option,
    stop_option,
)

OF_CANDIDATE = ("rename", "units", "isolation", "solver")
"""Entries of its component that are those of the candidate."""


@click.command()
@click.argument("candidate", type=PATH)
@click.option("--as", "component", required=True, metavar="COMPONENT", help="Component to replace.")
@click.option("--system", type=PATH, help="System file. Default: the built-in grasp.")
@preset_option
@set_option
@step_option
@stop_option
@click.option(
    "--bands",
    type=PATH,
    help="TOML file with bands, or the JSON of a qualification. Default: bands that are derived "
    "from runs of the original.",
)
@native_option
@metrics_option
@click.option("-o", "--out", type=PATH, help="Page to write, such as qualification.html.")
@json_option
def qualify(
    candidate: Path,
    component: str,
    bands: Path | None,
    native: bool | None,
    metric_files: tuple[Path, ...],
    out: Path | None,
    as_json: bool,
    overrides: Sequence[Override],
    **system_options: Any,
) -> int:
    """Judge whether CANDIDATE may replace a component.

    CANDIDATE is an FMU or a system file. From a system file the command takes the component with
    the same name. The command compares the two interfaces. Then it runs the closed loop with the
    original and with the candidate, and judges each signal and each metric by a band. The exit
    code is 1 if the candidate is not qualified.

    These keys of --set begin with components.COMPONENT: rename.VARIABLE=NAME maps a variable to its
    name in the candidate, and units.VARIABLE=UNIT corrects a unit. The candidate runs in a separate
    process, except with isolation=none. With solver.relative_tolerance=1e-6 it runs by model
    exchange, if it can.

    \b
    Example: grasp-cosim qualify vendor.fmu --as plant -o qualification.html
    """
    if out:
        check_file(out)
    is_file = candidate.suffix.lower() in FILES
    if not is_file:
        check_runs(candidate)
    of_system, of_component, values = _sorted_overrides(overrides, component)
    system = natively(chosen_system(SystemOptions(overrides=of_system, **system_options)), native)
    qualification = run_qualification(
        system,
        component,
        component_of(load_system(candidate), component, system) if is_file else candidate,
        rename=of_component["rename"],
        units=of_component["units"],
        values={override.place: override.value for override in each_once(values)},
        bands=read_bands(bands) if bands else None,
        isolation=of_component["isolation"].get("", "process"),
        solver={key: plain(value) for key, value in of_component["solver"].items()} or None,
        progress=not is_quiet(),
        metrics=chosen_metrics(metric_files),
    )
    if out:
        from ..comparison.comparison_page import (
            write_qualification,  # only here: pages take long to import
        )

        wrote = write_qualification(qualification, out)
        say(f"wrote {out}" if wrote else f"no page {out}: there were no two runs")
    show(
        as_json,
        summary.qualification_json(qualification),
        summary.qualification_text(qualification),
    )
    return 0 if qualification.qualified else NEGATIVE


def _sorted_overrides(
    overrides: Iterable[Override], component: str
) -> tuple[list[Override], dict[str, dict[str, Any]], list[Override]]:
    """The overrides of the system, entries of the candidate by name, and values of variables."""
    of_system: list[Override] = []
    of_component: dict[str, dict[str, Any]] = {entry: {} for entry in OF_CANDIDATE}
    values: list[Override] = []
    for override in overrides:
        section, name, entry, key = (*override.place.split(".", 3), "", "", "")[:4]
        if section == "components" and name == component and entry in OF_CANDIDATE:
            of_component[entry][key] = override.value
        elif section == "components" and entry == "values":
            values.append(replace(override, place=f"{name}.{key}"))
        elif section in SECTIONS:
            of_system.append(override)
        else:
            values.append(override)
    return of_system, of_component, values


@click.command()
@click.argument("run", type=PATH)
@click.option("-o", "--out", type=PATH, help="Page to write. Default: RUN/report.html.")
@click.option("--title", help="Title of the page. Default: system, case and controller.")
@json_option
def report(run: Path, out: Path | None, title: str | None, as_json: bool) -> int:
    """Write a page about a recorded run.

    RUN is a folder that `run --out` wrote. The page is one file with traces, metrics, connections
    and settings. It needs no network. With the extra `plot` the command also draws grasp.png next
    to the page, and timing.png for a run in real time.

    \b
    Example: grasp-cosim report results
    """
    with waiting(f"drawing {out or run / 'report.html'}"):
        from ..report.run_report import write_report  # only here: pages take long to import

        page, *drawn = write_report(run, out, title or "")
    size, pictures = page.stat().st_size, [str(picture) for picture in drawn]
    written = {"page": str(page), "bytes": size, "pictures": pictures}
    show(as_json, written, "\n".join([f"{page}: {size / 1e6:.1f} MB", *pictures]))
    return 0


@click.command()
@click.argument("before", type=PATH)
@click.argument("after", type=PATH)
@json_option
def diff(before: Path, after: Path, as_json: bool) -> int:
    """Show the changes of settings and metrics between two runs.

    BEFORE and AFTER are folders that `run --out` wrote. The first table lists the settings that
    differ. The second table lists the values of all metrics. The command gives no verdict, and its
    exit code is 0. Use `compare` to judge two runs by tolerance bands.

    \b
    Example: grasp-cosim diff before after
    """
    changes = changes_between(before, after)
    show(as_json, changes.as_dict(), repr(changes))
    return 0


@click.command()
@click.argument("a", type=PATH)
@click.argument("b", type=PATH)
@click.option("-o", "--out", type=PATH, help="Page to write, such as compare.html, with both runs.")
@click.option(
    "--bands", type=PATH, help="TOML file with bands. Default: bands that are derived from A."
)
@map_option
@metrics_option
@json_option
def compare(
    a: Path,
    b: Path,
    out: Path | None,
    bands: Path | None,
    names: LogNames,
    metric_files: tuple[Path, ...],
    as_json: bool,
) -> int:
    """Judge the differences of two runs by tolerance bands.

    A and B are folders that `run --out` wrote, system files, or logs from other tools. A system
    file (.toml or .ssp) runs as long as the other run. A log is an ASAM MDF file (.mf4) or a table
    with the column time and names such as plant.gap[1]. A head may contain a unit: "plant.gap[1]
    [mm]". For other names use --map.

    The command compares signals, metrics and settings over the common time. The exit code is 1 if a
    signal or metric is out of its band, or if a run did not reach its end.

    \b
    Example: grasp-cosim compare results_a results_b -o compare.html
    Compare with a log: grasp-cosim compare results bench.csv --map names.toml
    """
    if out:
        check_file(out)
    own_bands, metrics = read_bands(bands) if bands else None, chosen_metrics(metric_files)
    with waiting(f"comparing {a} and {b}"):
        comparison = compare_runs(a, b, bands=own_bands, metrics=metrics, names=names)
        if out:
            from ..comparison.comparison_page import (
                write_comparison,  # only here: pages take long to import
            )

            write_comparison(comparison, out)
    if out:
        say(f"wrote {out}: {out.stat().st_size / 1e6:.1f} MB")
    show(as_json, summary.as_json(comparison), summary.as_text(comparison))
    return 0 if comparison.alike else NEGATIVE
