"""The evaluation as a page, one file with its pictures inside, to be opened in a browser."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from string import Template
from typing import TYPE_CHECKING, Any

from ...base.text import fixed
from ...report.html_tables import cell, table
from ...report.plot import as_svg, legend_below, new_figure
from ...report.traces_page import page_style
from ...report.wording import about
from ...system.settings import changed
from ...system.times import in_seconds
from ..pictures import draw_contact_forces, draw_contact_times, draw_targets
from ..presets import CASES
from ..system import controller_name
from .published_figures import RED, REFLECTANCE_X_M, WHITE, Source
from .reproduction import AT_SENSOR_CONTACT, REPRODUCTIONS, Evidence

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ...recording.result import Result

PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<link rel="icon" href="data:,">
<title>$title</title>
<style>
$style
h2 { border: 0; padding: 0; }
td { white-space: nowrap; }
.claims td + td { white-space: normal; }
.chart { min-width: 0; max-width: 920px; }
@media (max-width: 760px) { .chart { min-width: 620px; } }
</style>
</head>
<body>
<header>
<h1>$title</h1>
<p class="sum">$summary</p>
<p class="sum about">$about</p>
</header>
<main>
$sections
</main>
</body>
</html>
""")

INTRODUCTION: Mapping[Source, str] = {
    "simulation": "The position table of the paper’s simulation against this co-simulation.",
    "experiment": "Both tables of the paper’s experiments against this co-simulation on the bench "
    "preset: the sensors with their electronics, the fingers with the friction that was identified "
    "from these times.",
}

NOTES: Mapping[Source, str] = {
    "simulation": "A finger touches where its gap is zero. The last column has the times if "
    "contact were declared at a gap of 0.37 mm, which is fitted to the published times and used "
    "nowhere else; evaluation.csv has those times, too.",
    "experiment": "Contact times are those of the positions and of equal colours, to which the "
    "friction was fitted; white on both sides is the row of 30 mm once more and counts once.",
}

CLAIM_TITLES = {
    "paper": "The claims of the paper",
    "reproduction": "Checks of this reproduction",
}
"""The headings of the claims by their origin."""

TABLE_TITLES = {
    "position": "By the position of the object",
    "reflectance": "By the colours of the right and the left face, the object at 30 mm",
}

METRIC_COLUMNS = (
    ("contact times in s", "time_to_contact", 1.0, 3),
    ("approach in mm/s", "impact_velocity", 1e3, 1),
    ("peak force in N", "peak_contact_force", 1.0, 2),
    ("settled force in N", "steady_contact_force", 1.0, 3),
)
"""The columns of the table of all grasps, for each finger: heading, metric, factor, decimals."""


def evaluation_html(evidence: Evidence, claims: Sequence[Mapping[str, Any]], source: Source) -> str:
    """Return the page as text."""
    system = evidence.system
    controller = system.component(controller_name(system), system.name).fmu.stem
    step_ms = 1e3 * in_seconds(system.step_ns)
    sections = [
        f"<section>\n<h2>{title}</h2>\n{html}\n</section>"
        for title, html in _sections(evidence, claims, source).items()
    ]
    return PAGE.substitute(
        title=f"{REPRODUCTIONS[source].title}, {escape(controller)}",
        style=page_style(),
        summary=f"{INTRODUCTION[source]} Steps of {step_ms:g} ms, {system.scheme}.",
        about=escape(about(changed(system))),
        sections="\n".join(sections),
    )


def _sections(
    evidence: Evidence, claims: Sequence[Mapping[str, Any]], source: Source
) -> dict[str, str]:
    """The HTML of the sections by their titles."""
    pictures = {
        title.capitalize(): _picture_html(title.capitalize(), figure)
        for title, figure in figures(evidence, source).values()
    }
    contact_times, *_ = pictures
    tables = {row["table"] for row in evidence.rows}
    return {
        **{
            title: _claims_html([claim for claim in claims if claim["origin"] == origin])
            for origin, title in CLAIM_TITLES.items()
        },
        "Deviations": _deviations_html(evidence.rms) + f'<p class="hint">{NOTES[source]}</p>',
        contact_times: pictures[contact_times],
        **{
            title: _published_html(evidence.rows, name)
            for name, title in TABLE_TITLES.items()
            if name in tables
        },
        **pictures,
        "Every grasp": _grasps_html(evidence),
    }


def _picture_html(title: str, figure: Figure) -> str:
    attributes = f'class="chart" role="img" aria-label="{title}"'
    return f'<div class="scroll"><div {attributes}>{as_svg(figure)}</div></div>'


def _claims_html(claims: Sequence[Mapping[str, Any]]) -> str:
    """A row for each claim: whether it holds, and its text."""
    rows = []
    for claim in claims:
        verdict = cell("holds") if claim["holds"] else cell("FAILS", class_="warn")
        rows.append(verdict + cell(claim["text"]))
    return table("", rows, "claims")


def _deviations_html(rms: Mapping[str, float]) -> str:
    """The root mean squares; those of contacts declared at 0.37 mm in their own column."""
    names = [name for name in rms if not name.endswith(AT_SENSOR_CONTACT)]
    heads = ["root mean square of simulated less published, s", ""]
    suffixes = [""]
    if len(names) < len(rms):
        heads.append("at 0.37 mm")
        suffixes.append(AT_SENSOR_CONTACT)
    rows = []
    for name in names:
        numbers = [_number(rms[name + suffix], 3) for suffix in suffixes]
        rows.append(_cells([name.replace("_", " ")], numbers))
    return table(_heads(heads), rows)


def _published_html(rows: Sequence[Mapping[str, Any]], table_name: str) -> str:
    """A row per grasp: published, simulated and their difference, of both fingers and between."""
    heads = ["object", "times in s"]
    for times in ("finger 1", "finger 2", "apart"):
        heads += [f"{times}<br>{figure}" for figure in ("published", "simulated", "difference")]
    numbers: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row["table"] == table_name:
            condition = row["condition"]
            if isinstance(condition, float):
                condition = f"{1e3 * condition:.0f} mm"
            numbers.setdefault((condition, f"Case {row['case']}"), []).extend(
                (
                    f"{row['published']:.2f}",
                    _number(row["simulated"], 3),
                    _number(row["difference"], 3, "+"),
                )
            )
    cells = [_cells(grasp, grasp_numbers) for grasp, grasp_numbers in numbers.items()]
    return table(_heads(heads, texts=2), cells)


def _grasps_html(evidence: Evidence) -> str:
    """A row per grasp: its metrics of both fingers, and where its target is in the end."""
    rows = []
    for run in evidence.runs.values():
        numbers = []
        for _, name, factor, decimals in METRIC_COLUMNS:
            of_fingers = [_number(factor * value, decimals) for value in run.metrics[name]]
            numbers.append(" / ".join(of_fingers))
        numbers.append(_number(1e3 * run.metrics["target_position"], 1))
        x_m, alpha_1, alpha_2 = run.setting
        faces = "" if alpha_1 == alpha_2 == 1.0 else f", {alpha_1:.2f} / {alpha_2:.2f}"
        rows.append(_cells([f"{1e3 * x_m:.0f} mm{faces}", f"Case {run.case}"], numbers))
    metric_heads = [heading for heading, *_ in METRIC_COLUMNS]
    return table(_heads(["object", "", *metric_heads, "target at the end in mm"], texts=2), rows)


def _heads(names: Sequence[str], texts: int = 1) -> str:
    """The cells of the heads, HTML already: so many columns of texts, then those of numbers."""
    kinds = [""] * texts + [' class="n"'] * (len(names) - texts)
    return "".join(f"<th{kind}>{name}</th>" for kind, name in zip(kinds, names, strict=True))


def _cells(texts: Iterable[str], numbers: Iterable[str]) -> str:
    """The cells of a row."""
    return "".join([*map(cell, texts), *(cell(number, class_="n") for number in numbers)])


def _number(value: float, decimals: int, sign: str = "") -> str:
    """A number of the tables; a difference too small for them is 0 there."""
    return fixed(value, decimals, sign=sign, rounded=True)


def figures(evidence: Evidence, source: Source) -> dict[str, tuple[str, Figure]]:
    """The pictures by name, each with its title; InputError without matplotlib."""
    runs = {key: run.result for key, run in evidence.runs.items() if run.result}
    case_0, case_1, case_2 = (runs[WHITE, case] for case in CASES)
    end = REPRODUCTIONS[source].picture_end
    place = f"object at {1e3 * REFLECTANCE_X_M:.0f} mm"
    both = [(case_1, "--", "Case 1"), (case_2, "-", "Case 2")]
    pictures = {
        "contact_times": (
            "contact times, simulated and published",
            _contact_times_figure(evidence),
        ),
        "contact_forces": (
            f"contact forces, {place}",
            _contact_forces_figure([case_0, case_1, case_2], end),
        ),
        "target_position": (f"target position, {place}", _targets_figure(both, end)),
        "target_position_case_0": (
            f"target position in Case 0, {place}",
            _targets_figure([(case_0, "-", "Case 0")], end),
        ),
    }
    if (RED, 2) in runs:
        colours = [(runs[RED, 2], "--", "red"), (case_2, "-", "white")]
        title = f"target position in Case 2 of red and of white faces, {place}"
        pictures["target_position_colours"] = (title, _targets_figure(colours, end))
    for _, figure in pictures.values():
        legend_below(figure)
    return pictures


def _contact_forces_figure(runs: Sequence[Result], end: float) -> Figure:
    """The contact forces, a row for each case, until a time in s."""
    figure = new_figure(7.2, 7.0)
    rows = figure.subplots(len(CASES), 1, sharex=True)
    for axes, case, run in zip(rows, CASES, runs, strict=True):
        draw_contact_forces(axes, run)
        axes.set_title(f"Case {case}", fontsize=10)
    _end_at(rows[-1], end)
    return figure


def _targets_figure(runs: Sequence[tuple[Result, str, str]], end: float) -> Figure:
    """The target positions of grasps, until a time in s."""
    figure = new_figure(7.2, 4.0)
    axes = figure.subplots()
    draw_targets(axes, runs)
    _end_at(axes, end)
    return figure


def _end_at(axes: Axes, end: float) -> None:
    axes.set_xlabel("time in s")
    axes.set_xlim(0.0, end)


def _contact_times_figure(evidence: Evidence) -> Figure:
    """The contact times, a row for each published table, a column for each of Cases 1 and 2."""
    names = list(dict.fromkeys(row["table"] for row in evidence.rows))
    figure = new_figure(9.0, 4.3) if len(names) == 1 else new_figure(11.0, 8.3)
    grid = figure.subplots(len(names), 2, sharey="row", squeeze=False)
    for name, pair in zip(names, grid, strict=True):
        rows = [row for row in evidence.rows if row["table"] == name]
        for case, axes in enumerate(pair, start=1):
            draw_contact_times(axes, rows, case)
    return figure
