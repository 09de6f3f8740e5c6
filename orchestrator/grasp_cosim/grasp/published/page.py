"""The evaluation as a page, one file with its pictures inside, to be opened in a browser."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from string import Template
from typing import TYPE_CHECKING, Any

from ...base.text import fixed
from ...report.html_tables import table
from ...report.plot import as_svg, legend_below, new_figure
from ...report.traces_page import page_style
from ...report.wording import about
from ...system.settings import changed
from ...system.times import in_seconds
from ..pictures import draw_contact_forces, draw_contact_times, draw_targets
from ..presets import CASES
from ..system import controller_name
from .compared import AT_SENSOR_CONTACT, REFLECTANCE_X_M, SOURCES, Evidence, Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    "simulation": "A finger touches where its gap is zero. The last column would be ours if "
    "contact were declared at a gap of 0.37 mm, which is fitted to the published times and used "
    "nowhere else; evaluation.csv has those times, too.",
    "experiment": "Contact times are those of the positions and of equal colours, to which the "
    "friction was fitted; white on both sides is the row of 30 mm once more and counts once.",
}

TABLES = {
    "position": "By the position of the object",
    "reflectance": "By the colours of the right and the left face, the object at 30 mm",
}

METRICS = (
    ("contact times in s", "time_to_contact", 1.0, 3),
    ("approach in mm/s", "impact_velocity", 1e3, 1),
    ("peak force in N", "peak_contact_force", 1.0, 2),
    ("settled force in N", "steady_contact_force", 1.0, 3),
)
"""The columns of the table of all grasps, for each finger: heading, metric, factor, decimals."""


def evaluation_html(evidence: Evidence, claims: Sequence[Mapping[str, Any]], source: Source) -> str:
    """Return the page as text."""
    system, rows = evidence.system, evidence.rows
    pictures = {
        title.capitalize(): f'<div class="scroll"><div class="chart" role="img" '
        f'aria-label="{title.capitalize()}">{as_svg(figure)}</div></div>'
        for title, figure in figures(evidence, source).values()
    }
    times = next(iter(pictures))
    words = {True: "<td>holds</td>", False: '<td class="warn">FAILS</td>'}
    judged = [f"{words[c['holds']]}<td>{escape(c['text'])}</td>" for c in claims]
    sections = {
        "Claims of the paper": table("", judged, "claims"),
        "Deviations": _deviations(evidence.rms) + f'<p class="hint">{NOTES[source]}</p>',
        times: pictures[times],
        **{TABLES[name]: _published(rows, name) for name in (row["table"] for row in rows)},
        **pictures,
        "Every grasp": _grasps(evidence),
    }
    controller = system.component(controller_name(system), system.name).fmu.stem
    step = 1e3 * in_seconds(system.step_ns)
    return PAGE.substitute(
        title=f"{SOURCES[source].title}, {escape(controller)}",
        style=page_style(),
        summary=f"{INTRODUCTION[source]} Steps of {step:g} ms, {system.scheme}.",
        about=escape(about(changed(system))),
        sections="\n".join(
            f"<section>\n<h2>{title}</h2>\n{html}\n</section>" for title, html in sections.items()
        ),
    )


def _deviations(rms: Mapping[str, float]) -> str:
    """The root mean squares; those of contacts declared at 0.37 mm in a column of their own."""
    names = [name for name in rms if not name.endswith(AT_SENSOR_CONTACT)]
    keys = ["", AT_SENSOR_CONTACT] if len(names) < len(rms) else [""]
    heads = ["root mean square of simulated less published, s", "", "at 0.37 mm"]
    cells = (_cells([n.replace("_", " ")], [_text(rms[n + key], 3) for key in keys]) for n in names)
    return table(_heads(heads[: 1 + len(keys)]), cells)


def _published(rows: Sequence[Mapping[str, Any]], name: str) -> str:
    """A row per grasp: published, simulated and their difference, of both fingers and between."""
    names = ("finger 1", "finger 2", "apart")
    heads = [f"{n}<br>{what}" for n in names for what in ("published", "simulated", "difference")]
    lines: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row["table"] == name:
            at = row["condition"]
            where = f"{1e3 * at:.0f} mm" if isinstance(at, float) else at
            lines.setdefault((where, f"Case {row['case']}"), []).extend(
                (
                    f"{row['published']:.2f}",
                    _text(row["simulated"], 3),
                    _text(row["difference"], 3, "+"),
                )
            )
    rows_html = (_cells(*line) for line in lines.items())
    return table(_heads(["object", "times in s", *heads], texts=2), rows_html)


def _grasps(evidence: Evidence) -> str:
    heads = ["object", "", *(heading for heading, *_ in METRICS), "target at the end in mm"]
    lines = []
    for run in evidence.runs.values():
        numbers = [
            " / ".join(_text(factor * value, decimals) for value in run.metrics[name])
            for _, name, factor, decimals in METRICS
        ]
        target = _text(1e3 * run.metrics["target_position"], 1)
        x_m, alpha_1, alpha_2 = run.setting
        faces = "" if alpha_1 == alpha_2 == 1.0 else f", {alpha_1:.2f} / {alpha_2:.2f}"
        lines.append(_cells([f"{1e3 * x_m:.0f} mm{faces}", f"Case {run.case}"], [*numbers, target]))
    return table(_heads(heads, texts=2), lines)


def _heads(names: Sequence[str], texts: int = 1) -> str:
    kinds = [""] * texts + [' class="n"'] * (len(names) - texts)
    return "".join(f"<th{kind}>{name}</th>" for kind, name in zip(kinds, names, strict=True))


def _cells(texts: Iterable[str], numbers: Iterable[str]) -> str:
    """The cells of a row."""
    return "".join(
        [*(f"<td>{escape(t)}</td>" for t in texts), *(f'<td class="n">{n}</td>' for n in numbers)]
    )


def _text(value: float, decimals: int, sign: str = "") -> str:
    """A number of the tables; a difference too small for them is 0 there."""
    return fixed(value, decimals, sign=sign, rounded=True)


def figures(evidence: Evidence, source: Source) -> dict[str, tuple[str, Figure]]:
    """The pictures by name, each with its title; InputError without matplotlib."""
    how, runs = SOURCES[source], {r.case: r.result for r in evidence.runs.values() if r.result}
    names = list(dict.fromkeys(row["table"] for row in evidence.rows))
    times = new_figure(9.0, 4.3) if len(names) == 1 else new_figure(11.0, 8.3)
    grid = times.subplots(len(names), 2, sharey="row", squeeze=False)
    for name, pair in zip(names, grid, strict=True):
        for case, axes in enumerate(pair, start=1):
            draw_contact_times(axes, [r for r in evidence.rows if r["table"] == name], case)
    forces, targets = new_figure(7.2, 7.0), new_figure(7.2, 4.0)
    rows, below = forces.subplots(len(CASES), 1, sharex=True), targets.subplots()
    for axes, case in zip(rows, CASES, strict=True):
        draw_contact_forces(axes, runs[case])
        axes.set_title(f"Case {case}", fontsize=10)
    draw_targets(below, [(runs[1], "--", "Case 1"), (runs[2], "-", "Case 2")])
    for axes in (rows[-1], below):
        axes.set_xlabel("time in s")
        axes.set_xlim(0.0, how.shown)
    for figure in (times, forces, targets):
        legend_below(figure)
    where = f"object at {1e3 * REFLECTANCE_X_M:.0f} mm"
    return {
        "contact_times": ("contact times, simulated and published", times),
        "contact_forces": (f"contact forces, {where}", forces),
        "target_position": (f"target position, {where}", targets),
    }
