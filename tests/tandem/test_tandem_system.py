"""The gripper in tandem as a system: with its wrist moved it leaves a free box where it is."""

from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, System, simulate, tandem_system
from grasp_cosim.grasp.system import with_controller
from grasp_cosim.ssp.to_archive import write_ssp
from grasp_cosim.tandem.metrics import check
from hil.test_closed_loop import assert_same, on_the_bench
from support.marks import needs_compiler, slow

PUBLISHED = "plant.wrist.bandwidth = 5 Hz: the published law wants a wrist of 100 Hz"


@pytest.fixture(scope="module")
def tandem():
    return tandem_system(native=False)


@pytest.fixture(scope="module")
def moved(tandem):
    return simulate(tandem)


def test_both_fingers_touch_a_free_box_at_once_and_leave_it_where_it_is(moved):
    metrics = moved.metrics
    assert metrics["time_difference"] < 1e-3
    assert max(metrics["impact_velocity"]) < 6.5e-3
    assert metrics["object_shift"] < 1e-6
    assert metrics["steady_contact_force"] == pytest.approx([98.0 * 0.035] * 2, rel=0.02)
    assert metrics["wrist_travel"] == pytest.approx(0.03, abs=1e-5)
    assert metrics["peak_wrist_speed"] == np.abs(moved["plant.wrist_velocity"]).max()


def test_a_wrist_that_is_not_moved_has_the_box_carried_to_it(tandem):
    metrics = simulate(tandem.with_presets("case_1")).metrics
    assert metrics["time_difference"] > 1.0
    assert metrics["object_shift"] == pytest.approx(0.03, abs=1e-4)
    assert metrics["wrist_travel"] == 0.0


@pytest.mark.slow
def test_the_published_law_wants_a_fast_wrist_and_its_force(tandem):
    """Then its contacts are those of two fingers, which test_against_continuous_solution has."""
    published = with_controller(tandem, "published")
    fast = published.with_values({"plant.wrist.bandwidth": 100.0}).with_presets("fixed")
    contacts = simulate(fast, step=1e-4, stop=2.1).metrics["time_to_contact"]
    assert contacts == pytest.approx([1.887, 1.897], abs=3e-3)
    slow_one = simulate(published.with_presets("fixed"))
    assert max(slow_one.metrics["peak_contact_force"]) > 10.0


def test_the_force_of_the_wrist_is_measured_by_the_law_that_wants_it(tandem):
    published = with_controller(tandem, "published")
    assert "plant.wrist_force -> controller.wrist_force" in map(str, published.connections)
    again = with_controller(published, "adaptive")
    assert set(again.connections) == set(tandem.connections)
    assert again.component("controller", "").fmu.name == "GraspControllerTandem.fmu"


@pytest.mark.parametrize(
    ("presets", "apart", "forces"),
    [
        slow(("bench",), 0.01, 3.4),
        (("arm", "bench"), 0.01, 3.4),
        slow(("gripper", "fixed"), 0.005, 2.78),
        slow(("arm", "gripper", "bench", "fixed"), 0.01, 2.77),
    ],
)
def test_presets_are_what_arms_grippers_and_sensors_are(tandem, presets, apart, forces):
    metrics = simulate(tandem.with_presets(*presets)).metrics
    assert metrics["time_difference"] < apart
    assert metrics["steady_contact_force"] == pytest.approx([forces] * 2, abs=0.2)


@pytest.mark.parametrize(
    ("values", "notes"),
    [
        ({}, []),
        (
            {"plant.wrist.bandwidth": 3.0},
            ["plant.wrist.bandwidth = 3 Hz: the law counts on more, "],
        ),
        ({"plant.wrist.delay": 0.01}, ["plant.wrist.delay = 0.01 s: the law counts on less, "]),
        (
            {"plant.wrist.bandwidth": 1.5, "controller.wrist.bandwidth": 1.5},
            ["controller.wrist.bandwidth = 1.5 Hz, delay = 0 s: the wrist lags by 0.212 s"],
        ),
        ({"controller.wrist.delay": 0.05}, []),
    ],
)
def test_a_wrist_that_the_law_does_not_count_on_is_noted(tandem, values, notes):
    found = check(tandem.with_values(values))
    assert len(found) == len(notes)
    assert all(note in said for note, said in zip(notes, found, strict=True))


def test_that_it_is_too_slow_for_the_published_law_is_noted_by_a_run(tandem):
    run = simulate(with_controller(tandem, "published"), stop=0.01)
    assert any(PUBLISHED in note for note in run.log)


def test_a_plant_of_others_has_no_such_notes(tandem):
    """As one has that calls its parameters otherwise: here the two-finger plant's variables."""
    names = {"plant": "gripper"}
    foreign = [c for c in tandem.components if c.name.startswith("sensor")]

    class Foreign:
        components = tuple(foreign)
        roles = names

    assert check(Foreign) == ()


def test_an_archive_of_it_gives_the_same_run(tandem, moved, tmp_path):
    write_ssp(tandem, tmp_path / "tandem.ssp")
    again = simulate(System.load(tmp_path / "tandem.ssp"))
    for name in moved.signals:
        np.testing.assert_array_equal(again[name], moved[name], name)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("law", ["adaptive", "published"])
def test_native_fmus_give_the_bits_of_the_python_ones(tandem, law):
    """Over a delay that is no whole number of steps, limits, a speed servo and electronics."""
    system = with_controller(tandem, law).with_presets("gripper", "bench")
    system = system.with_values(
        {
            "plant.wrist.delay": 0.0123,
            "plant.wrist.speed_limit": 0.1,
            "plant.wrist.acceleration_limit": 1.0,
            "plant.wrist.compliance": 1e-4,
        }
    )
    python, native = simulate(system, stop=2.5), simulate(system.natively(True), stop=2.5)
    for name, column in python.items():
        np.testing.assert_array_equal(column, native[name], name)


@pytest.mark.slow
def test_plant_and_controller_on_the_bench_change_no_bit(tandem, tmp_path):
    system = tandem.with_experiment(step=4e-3, stop=2.4)
    direct = simulate(system, engine="python")
    with on_the_bench(system, tmp_path, "plant", "controller") as benched:
        assert_same(direct, simulate(benched, engine="python"))


def test_the_command_writes_a_system_that_runs(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert command("init", "tandem.toml", "--tandem")[0] == 0
    assert System.load("tandem.toml").with_experiment(stop=0.1) is not None
    code, _, said = command("init", "other.toml", "--tandem", "--fingers", "3")
    assert code == 2
    assert "--fingers and --angles cannot be used with --tandem; each makes" in said


VENDOR = '''"""A gripper on an arm in other words."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter
from gripper_plant import tandem


@dataclass(frozen=True)
class Params:
    offset: Annotated[float, Parameter("place of the object", unit="m", low=-1.0, high=1.0)] = 0.03


class Inputs(NamedTuple):
    gripForce: Annotated[float, Input("force of the drive", unit="N", nominal=1.0)] = 0.0
    wristCommand: Annotated[float, Input("commanded position", unit="m", nominal=0.1)] = 0.0


Pair = tuple[float, float]


class Outputs(NamedTuple):
    pos: Annotated[Pair, Output("position of the finger", unit="m", nominal=0.1, depends_on=set())]
    vel: Annotated[Pair, Output("its velocity", unit="m/s", nominal=0.1, depends_on=set())]
    distance: Annotated[Pair, Output("gap to the object", unit="m", nominal=0.1, depends_on=set())]


State = tandem.State


def placed(p):
    return tandem.Params(initial_object_position=p.offset)


def initial_state(p, u):
    return tandem.initial_state(placed(p), tandem.Inputs(*u))


def step(p, x, u, h):
    return tandem.step(placed(p), x, tandem.Inputs(*u), h)


def outputs(p, x, u):
    y = tandem.outputs(placed(p), x, tandem.Inputs(*u))
    return Outputs(y.position, y.velocity, y.gap)
'''
"""It tells neither forces nor contacts, nor where its wrist is."""


@pytest.mark.slow
def test_a_plant_of_others_has_the_metrics_that_it_permits(command, moved, tmp_path):
    Path("vendor.py").write_text(VENDOR, encoding="utf-8")
    assert command("build", "vendor.py", "--out", ".")[0] == 0
    assert command("init", "mine.toml", "--tandem", "--as", "plant=Vendor.fmu")[0] == 0
    run = simulate(System.load("mine.toml"))
    for name in ("time_to_contact", "impact_velocity"):  # of samples, and as the plant has them
        assert run.metrics[name] == pytest.approx(moved.metrics[name], rel=1e-3)
    assert "steady_contact_force" not in run.metrics
    assert [said.partition(": ")[2] for said in run.measured.missing] == [
        "plant lacks contact_force[1]",
        "plant lacks object_position",
        "plant lacks wrist_position",
        "plant lacks wrist_velocity",
    ]


def test_a_law_that_there_is_not_is_refused(tandem):
    with pytest.raises(InputError, match="controller = 'exact'"):
        with_controller(tandem, "exact")
