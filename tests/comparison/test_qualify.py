"""Qualifications in the closed loop: a copy, altered plants, failures, bands of a file."""

import json
import math
from dataclasses import replace

import pytest
from conftest import alter
from grasp_cosim import InputError, SimulationError
from grasp_cosim.comparison.bands import Bands, Given, read_bands
from grasp_cosim.comparison.qualify import qualify
from grasp_cosim.comparison.words import (
    qualification_json as as_json,
)
from grasp_cosim.comparison.words import (
    qualification_text as as_text,
)

NUMERICS = ("every second sample", "step 0.002 s", "scheme jacobi")


@pytest.fixture(scope="module")
def short(grasp):
    """The beginning of the grasp."""
    return grasp.with_experiment(step=1e-3, stop=0.05)


@pytest.fixture(scope="module")
def heavy(tmp_path_factory):
    """The plant with a heavier second finger, which its model description tells."""
    before = "high=1e3, tunable=True)\n    ] = (0.5, 0.5)"
    after = before.replace("0.5)", "0.6)")
    folder = tmp_path_factory.mktemp("heavy")
    return alter(folder, "python", "GripperPlant", "gripper_plant/fingers.py", before, after)


@pytest.fixture(scope="module")
def copied(short):
    """The qualification of the plant that is there already."""
    return qualify(short, "plant", own_plant(short), isolation="none")


@pytest.fixture(scope="module")
def heavier(short, heavy):
    """That of the heavier finger."""
    return qualify(short, "plant", heavy, isolation="none")


def by_name(compared):
    return {c.name: c for c in compared}


def own_plant(system):
    return system.component("plant", "test").fmu


def test_a_copy_is_qualified_without_any_deviation(copied):
    found = copied
    assert found.qualified
    assert found.swap.differences == ()
    assert found.numerics == NUMERICS
    assert found.failure is None
    assert len(found.signals) >= 21
    assert len(found.metrics) + len(found.absent) == 19
    assert {c.deviation for c in (*found.signals, *found.metrics)} == {0.0}
    assert all(c.band.source == "derived" for c in (*found.signals, *found.metrics))
    assert by_name(found.signals)["plant.gap[1]"].band.time == 0.002  # two steps
    assert as_text(found).startswith("QUALIFIED: GripperPlant.fmu as plant")


def test_without_anything_to_compare_there_is_no_qualification(copied):
    assert replace(copied, signals=()).qualified
    found = replace(copied, signals=(), metrics=())
    assert not found.qualified
    assert as_text(found).startswith("NOT QUALIFIED")
    assert as_json(found)["reason"].startswith("nothing was compared: no output")


def test_a_heavier_finger_is_not_qualified(heavier):
    found = heavier
    assert not found.qualified
    assert [(d.severity, d.kind, d.variable) for d in found.swap.differences] == [
        ("warns", "start", "finger_mass[2]")
    ]
    outside = [c.name for c in found.outside]
    assert "controller.force[2]" in outside
    assert not any("[1]" in name for name in outside if name.startswith("plant."))
    ratios = [c.ratio for c in found.signals]
    assert ratios == sorted(ratios, reverse=True)
    assert found.signals[0].ratio > 1.0
    worst = found.signals[0]
    assert worst.original is not None
    assert worst.candidate is not None
    assert worst.deviation == pytest.approx(abs(worst.candidate - worst.original), rel=1e-12)


def test_the_deviation_is_that_of_the_runs(short, heavy):
    """A finger under the same force falls behind by as much as it is heavier."""
    bands = Bands("b.toml", {"*": Given(absolute=1e-12, time=0.0)})
    found = qualify(short, "plant", heavy, bands=bands, isolation="none")
    original, candidate = (run["plant.velocity[2]"].values for run in found.runs)
    largest = float(abs(original - candidate).max())
    compared = by_name(found.signals)["plant.velocity[2]"]
    assert compared.deviation == pytest.approx(largest, rel=1e-12)
    assert candidate[2] / original[2] == pytest.approx(0.5 / 0.6, rel=1e-3)


def test_bands_of_a_file_decide(short, heavy):
    wide = Bands("b.toml", {"*": Given(relative=1.0)}, {"*": Given(absolute=math.inf)})
    found = qualify(short, "plant", heavy, bands=wide, isolation="none")
    assert found.qualified
    assert found.numerics == ()  # nothing is derived, so the original is run once
    assert {c.band.source for c in (*found.signals, *found.metrics)} == {"given"}


def test_bands_that_are_not_given_are_derived(short, heavy):
    tight = Bands("b.toml", {"plant.gap[2]": Given(absolute=1e-15, time=0.0)})
    found = qualify(short, "plant", heavy, bands=tight, isolation="none")
    sources = {c.name: c.band.source for c in found.signals}
    assert sources.pop("plant.gap[2]") == "given"
    assert set(sources.values()) == {"derived"}
    assert found.numerics == NUMERICS


@pytest.mark.parametrize("table", ["signals", "metrics"])
def test_a_band_for_nothing_is_a_wrong_input(short, table):
    bands = Bands("b.toml", **{table: {"plant.gapp": Given(absolute=1.0)}})
    with pytest.raises(InputError, match=rf"b.toml: \[{table}\]: nothing is called 'plant.gapp'"):
        qualify(short, "plant", own_plant(short), bands=bands, isolation="none")


def test_a_written_band_file_gives_the_same_verdict(short, heavy, heavier, tmp_path):
    first = heavier
    (tmp_path / "first.json").write_text(json.dumps(as_json(first)))
    bands = read_bands(tmp_path / "first.json")
    second = qualify(short, "plant", heavy, bands=bands, isolation="none")
    assert [(c.name, c.ratio) for c in second.signals] == [(c.name, c.ratio) for c in first.signals]
    assert second.numerics == ()


CONTACT = "s_1, v_1, f_1 = contact.advance("


def test_a_candidate_that_fails_on_the_way(short, altered):
    trap = f"if u_2 > 0.5:\n        raise RuntimeError('the motor burns')\n    {CONTACT}"
    fmu = altered("GripperPlant", "gripper_plant/rigid.py", CONTACT, trap)
    found = qualify(short, "plant", fmu, isolation="none")
    assert not found.qualified
    assert found.failure is not None
    assert "the motor burns" in found.failure
    assert found.metrics == ()
    assert {c.deviation for c in found.signals} == {0.0}  # until then
    assert found.runs[1]["plant.gap[1]"].time[-1] < 0.05
    text = as_text(found)
    assert text.startswith("NOT QUALIFIED")
    assert "the motor burns" in text.splitlines()[1]


def test_a_candidate_that_refuses_its_parameters(short, altered):
    before = "right, left = self.initial_position"
    trap = "if self.initial_object_position == 0.01:\n            raise ValueError('no licence')"
    refuse = f"{trap}\n        {before}"
    fmu = altered("GripperPlant", "gripper_plant/fingers.py", before, refuse)
    moved = short.with_values({"plant.initial_object_position": 0.01})
    found = qualify(moved, "plant", fmu, isolation="none")
    assert not found.qualified
    assert found.failure is not None
    assert "no licence" in found.failure
    assert found.signals == ()


def test_an_original_that_fails_is_no_verdict(short, altered):
    trap = f"if u_2 > 0.5:\n        raise RuntimeError('the motor burns')\n    {CONTACT}"
    fmu = altered("GripperPlant", "gripper_plant/rigid.py", CONTACT, trap)
    with pytest.raises(SimulationError, match="the motor burns"):
        qualify(short.swap("plant", fmu), "plant", own_plant(short), isolation="none")


def test_ctrl_c_is_no_verdict(short, monkeypatch):
    import grasp_cosim.comparison.qualify as module

    class Interrupted:
        complete = False

    monkeypatch.setattr(module, "simulate", lambda *_, **__: Interrupted())
    with pytest.raises(KeyboardInterrupt):
        qualify(short, "plant", own_plant(short), isolation="none")


def test_a_blocked_candidate_is_not_run(short, fmus):
    found = qualify(short, "plant", fmus / "ProximitySensor.fmu")
    assert not found.qualified
    assert (found.signals, found.metrics, found.numerics) == ((), (), ())
    report = as_json(found)
    assert report["reason"].startswith("not run, the interface does not fit: force[1], ")
    blocked = {d["variable"] for d in report["differences"] if d["severity"] == "blocks"}
    assert {"force[1]", "gap[2]", "velocity[1]"} <= blocked
    assert "blocks  missing" in as_text(found)


def test_json_holds_all_of_it(heavy, heavier):
    report = json.loads(json.dumps(as_json(heavier), allow_nan=False))
    assert set(report) == {
        "qualified", "reason", "component", "original", "candidate", "system", "step", "stop",
        "scheme", "failure", "differences", "signals", "metrics", "no_value", "uncompared",
        "numerics", "log", "bands", "units",
    }  # fmt: skip
    assert report["qualified"] is False
    assert report["component"] == "plant"
    assert report["candidate"] == str(heavy)
    assert (report["step"], report["stop"], report["scheme"]) == (1e-3, 0.05, "sequential")
    worst = report["signals"][0]
    assert set(worst) == {
        "name", "unit", "inside", "ratio", "deviation", "band", "band_time", "band_source", "time",
        "original", "candidate", "span",
    }  # fmt: skip
    assert worst["ratio"] == pytest.approx(worst["deviation"] / worst["band"])
    assert {m["unit"] for m in report["metrics"]} == {"m", "N"}
