"""The evaluation as a table and as a page to read."""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from ...numerals import fixed
from ...plain import to_cell
from ...system.description import System
from ...system.parts import NANOSECONDS
from ..controllers import controller_name

FIGURES = """## Figures

![Contact forces](contact_forces.png)

![Target position](target_position.png)"""


def table_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows, of one form, as CSV; no cell is a formula, see plain.to_cell()."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    table = [list(rows[0]), *(list(row.values()) for row in rows)]
    writer.writerows([to_cell(cell) for cell in row] for row in table)
    return text.getvalue()


def markdown(report: Mapping[str, Any], system: System) -> str:
    """The report, with the pictures beside it, as Markdown."""
    step = system.step_ns / NANOSECONDS
    rms = {key: _rounded(value, 3) for key, value in report["rms"].items()}
    return f"""# The published grasp, simulated again

Cases 1 and 2 of the paper's position table against this co-simulation, {_controller(system)}:
four FMUs, {system.scheme} scheme, communication step {1e3 * step:g} ms. Times in seconds.

The object is named by its position in m.

- *published*: the paper's simulation, to two decimals.
- *simulated*: ours, contact where the gap is zero.
- *difference*: simulated less published.
- *at 0.37 mm*: ours, if contact were declared where the gap is 0.37 mm. That gap is fitted to the
  published contact times; nothing else in the project uses it.

{_table(report["rows"])}

| root mean square of the differences, s | contact at zero gap | contact at 0.37 mm |
|---|---|---|
| contact times | {rms["contact_times"]} | {rms["contact_times_at_0.37_mm"]} |
| time differences | {rms["time_differences"]} | {rms["time_differences_at_0.37_mm"]} |

![Contact times over the object position](contact_times.png)

{FIGURES}

{_claim_list(report["claims"])}

{_run_table(report["runs"])}
"""


def bench_markdown(report: Mapping[str, Any], system: System) -> str:
    """The report of the experiments, with the pictures beside it, as Markdown."""
    step = system.step_ns / NANOSECONDS
    position, colour = (
        [r for r in report["rows"] if r["table"] == table] for table in ("position", "reflectance")
    )
    rms = "\n".join(
        f"| {name.replace('_', ' ')} | {_rounded(value, 3)} |"
        for name, value in report["rms"].items()
    )
    return f"""# The published experiments on the bench preset

Cases 0, 1 and 2 in the settings of both experimental tables against this co-simulation,
{_controller(system)}: the sensors with their electronics, the fingers with identified friction,
{system.scheme} scheme, communication step {1e3 * step:g} ms. Times in seconds; *difference* is
simulated less published.

| root mean square of the differences, s | |
|---|---|
{rms}

*contact times* are those of the positions and of equal colours, to which friction was fitted; white
on both sides is the row of 0.03 m once more and counts once there.

![Contact times over object position and by colour](contact_times.png)

{_claim_list(report["claims"])}

## By the position of the object, in m

{_table(position)}

## By the colours of the right and left surface, the object at 0.03 m

{_table(colour)}

{FIGURES}

{_run_table(report["runs"])}
"""


def _controller(system: System) -> str:
    """The controller, by its FMU."""
    return f"with {controller_fmu(system)}"


def controller_fmu(system: System) -> str:
    """Return the name of the controller's FMU."""
    return system.component(controller_name(system), system.name).fmu.stem


def _table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Published and simulated times; more columns where the rows have those at 0.37 mm."""
    more = "simulated_at_0.37_mm" in rows[0]
    lines = [
        "| object | case | | published | simulated | difference |"
        + (" at 0.37 mm | difference |" if more else ""),
        "|---|---|---|---|---|---|" + ("---|---|" if more else ""),
    ]
    for r in rows:
        what = f"finger {r['finger']}" if r["finger"] else "time difference"
        line = (
            f"| {_condition(r)} | {r['case']} | {what} | {r['published']:.2f} "
            f"| {_rounded(r['simulated'], 3)} | {_rounded(r['difference'], 3, sign='+')} |"
        )
        if more:
            simulated, difference = r["simulated_at_0.37_mm"], r["difference_at_0.37_mm"]
            line += f" {_rounded(simulated, 3)} | {_rounded(difference, 3, sign='+')} |"
        lines.append(line)
    return "\n".join(lines)


def _condition(row: Mapping[str, Any]) -> str:
    condition = row["condition"]
    return f"{condition:.2f}" if isinstance(condition, float) else str(condition)


def _claim_list(claims: Sequence[Mapping[str, Any]]) -> str:
    lines = (f"- **{'holds' if c['holds'] else 'FAILS'}**: {c['text']}" for c in claims)
    return "\n".join(["## Claims\n", *lines])


def _run_table(runs: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        "## Every grasp\n",
        "| object | case | contact times, s | approach speed, mm/s | peak force, N "
        "| settled force, N | target at the end, m |",
        "|---|---|---|---|---|---|---|",
    ]
    for r in runs:
        times, speeds, peaks, steady = (
            " / ".join(_rounded(factor * value, decimals) for value in r[key])
            for key, factor, decimals in (
                ("time_to_contact", 1.0, 3),
                ("impact_velocity", 1e3, 1),
                ("peak_contact_force", 1.0, 2),
                ("steady_contact_force", 1.0, 3),
            )
        )
        lines.append(
            f"| {_condition(r)} | {r['case']} | {times} | {speeds} | {peaks} | {steady} "
            f"| {_rounded(r['target_position'], 4)} |"
        )
    return "\n".join(lines)


def _rounded(value: float, decimals: int, sign: str = "") -> str:
    """A number of the tables; a difference too small for them is 0 there."""
    return fixed(value, decimals, sign=sign, rounded=True)
