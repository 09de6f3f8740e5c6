"""The command tune: what it writes and says, and one line per mistake."""

import csv
import json
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest
from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM

Run = Callable[..., tuple[int, str, str]]

QUICK = (
    "tune", "--step", "2e-3", "--stop", "0.3", "--minimise", "target_position", "--workers", "1",
    "--vary", "controller.simultaneous_contact.gain=0.5:20",
    "--condition", "plant.initial_object_position=0.02", "--budget", "14",
)  # fmt: skip
"""Of how far the target goes in 0.3 s: less is more gain, so that the upper bound is best."""

VISCOSITY = "controller.impact_reduction.viscosity"

NO_LIMITS = tuple(
    part
    for name in ("impact_velocity", "time_difference", "force_overshoot")
    for part in ("--limit", f"{name}=none")
)


@pytest.mark.slow
def test_the_best_grasp_is_found_checked_written_and_can_be_pasted(
    command: Run, tmp_path: Path, fmus: Path
) -> None:
    """Everything in one, as it starts processes: with two gains of layer 2 and one condition."""
    asked = (
        "tune", "--budget", "40", "--out", "tuned", "--plot", "--json", "--workers", "2",
        "--vary", "controller.impact_reduction.stiffness=10:100",
        "--vary", f"{VISCOSITY}[1],{VISCOSITY}[2]=0.2:3",
        "--condition", "plant.initial_object_position=0.03",
    )  # fmt: skip
    code, out, err = command(*asked)
    found = json.loads(out)
    assert json.loads((tmp_path / "tuned/tuning.json").read_text()) == found
    assert "drew tuned/tuning.png" in err
    assert (tmp_path / "tuned/tuning.png").read_bytes().startswith(b"\x89PNG")

    start, tuned, limits = found["start"], found["tuned"], found["limits"]
    assert limits["impact_velocity"] == start["impact_velocity"]
    assert tuned["grasp_time"] < start["grasp_time"]
    assert all(tuned[name] <= most for name, most in limits.items())
    gains = tuned["gains"]
    assert (
        gains["controller.impact_reduction.viscosity[2]"]
        == -(gains["controller.impact_reduction.viscosity[1]"])
    )
    broken = [c["condition"] for c in found["checks"] if c["broken"]]
    assert len(found["checks"]) == 6
    assert code == (1 if broken_by_the_new(found) else 0)
    assert "20 mm, bench, friction" in broken  # not even those published keep the limits there

    with (tmp_path / "tuned/points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == found["points"] <= 40
    assert sum(row["kept"] == "True" for row in rows) >= 2

    pasted = tmp_path / "pasted.toml"
    pasted.write_text(SYSTEM.read_text() + (tmp_path / "tuned/tuned.toml").read_text())
    system = System.load(pasted, fmus).with_presets("tuned")
    metrics = simulate(system, step=1e-3, stop=4.0).metrics
    times = zip(metrics["time_to_contact"], metrics["settling_time"], strict=True)
    assert max(a + b for a, b in times) == tuned["grasp_time"]
    assert max(metrics["impact_velocity"]) == tuned["impact_velocity"]


def broken_by_the_new(found: dict[str, object]) -> bool:
    """True if the new gains break a limit in a check that those before keep."""
    checks, limits = found["checks"], found["limits"]
    assert isinstance(checks, list)
    assert isinstance(limits, dict)
    return any(
        c["start"][name] is not None and c["start"][name] <= limits[name]
        for c in checks
        for name in c["broken"]
    )


@pytest.mark.slow
def test_the_text_has_both_gains_the_limits_and_the_options(command: Run) -> None:
    code, out, _ = command(*QUICK, *NO_LIMITS)
    lines = out.splitlines()
    assert code == 0
    assert lines[0] == "least target position, the worst of: plant.initial_object_position=0.02"
    (row,) = [line for line in lines if line.startswith("controller.simultaneous_contact.gain ")]
    assert row.split()[1] == "3"
    assert row.endswith("0.5 to 20 N AT ITS BOUND") is (row.split()[2] in ("0.5", "20"))
    options = shlex.split(lines[-1].removeprefix("as options: "))
    assert options[0] == "--set"
    assert options[1].startswith("controller.simultaneous_contact.gain=")


@pytest.mark.slow
def test_where_nothing_keeps_the_limits_the_result_is_negative(
    command: Run, tmp_path: Path
) -> None:
    """No finger touches within 0.3 s, so none has a speed at which it does."""
    code, out, _ = command(*QUICK, "--limit", "impact_velocity=0.01", "--limit",
                           "time_difference=none", "--limit", "force_overshoot=none",
                           "--out", "tuned")  # fmt: skip
    assert code == 1
    assert out.splitlines()[-1] == "NONE of the points keeps all limits"
    assert sorted(p.name for p in (tmp_path / "tuned").iterdir()) == ["points.csv", "tuning.json"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--vary", "plant.object_width"), "--vary 'plant.object_width': must be VARIABLE[,VAR"),
        (("--vary", "plant.object_width=1"), "--vary 'plant.object_width=1': must be VARIABLE[,V"),
        (("--vary", "plant.object_width=2:1"), "plant.object_width: bounds 2.0 to 1.0: must have"),
        (("--vary", "plant.width=1:2"), "plant.width: GripperPlant.fmu has no variable 'width'"),
        (("--vary", "controller.contact_force.damping=1:1e9"), "with_values controller.contact_f"),
        (("--limit", "impact_velocity=fast"), "--limit 'impact_velocity=fast': must be METRIC, M"),
        (("--limit", "impact_speed=1"), "no metric 'impact_speed'; did you mean impact_"),
        (("--minimise", "speed"), "no metric 'speed'; valid: time_to_contact"),
        (("--minimise", "time_difference"), "limit time_difference: is on what is to be least;"),
        (("--condition", "plant.object_width"), "--condition 'plant.object_width': must be VARI"),
        (("--condition", "plant.width=1"), "--condition plant.width"),
        (("--budget", "20"), "budget = 20: must be a whole number 22 to 1000000, for 7 gains"),
        ((*NO_LIMITS, "--plot"), "--plot: no limit; must have one, whose metric is the other axis"),
        (
            ("--set", "controller.simultaneous_contact.gain=0"),
            "controller.simultaneous_contact.gain = 0: has no range of its own; --vary must give",
        ),
    ],
)
def test_a_mistake_is_one_line(command: Run, arguments: tuple[str, ...], said: str) -> None:
    code, out, err = command("tune", "--python", *arguments)
    assert (code, out) == (2, "")
    (line,) = err.splitlines()
    assert line.startswith(f"grasp-cosim: {said}")
