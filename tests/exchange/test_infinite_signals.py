"""A distance to nothing, inf, goes to inputs that take it; from anywhere else it ends the run."""

import sys
from math import inf, nan

import pytest
from grasp_cosim import SimulationError
from grasp_cosim.exchange.divergence import to_open_ends
from grasp_cosim.system.parts import Connection, Port
from support.mocks import Mock, Run, make_system

STEPS = 4
LARGEST = sys.float_info.max


def looking(folder, gaps, infinite=(True,), **more):
    """A plant with a gap for each communication point, and sensors that see something near."""
    plant = Mock(folder, "plant", lambda u, t: gaps[round(10.0 * t)])
    sensors = [
        Mock(folder, f"sensor_{i}", lambda u, t: 0.0 if u > 1e6 else 1.0, infinite=takes_it)
        for i, takes_it in enumerate(infinite)
    ]
    wires = [Connection(Port("plant", "y"), Port(sensor.name, "u")) for sensor in sensors]
    mocks = [plant, *sensors]
    return Run(make_system(mocks, wires, STEPS, **more), mocks)


@pytest.mark.parametrize("nothing", [inf, -inf, LARGEST, 1e40])
def test_a_sensor_that_takes_inf_sees_nothing_and_the_run_goes_on(tmp_path, nothing):
    run = looking(tmp_path, [nothing, nothing, 0.1, nothing, 0.1])
    signals = run.to_the_end()
    seen = 1.0 if nothing < 0.0 else 0.0
    assert signals["plant.y"] == [nothing, nothing, 0.1, nothing, 0.1]
    assert signals["sensor_0.y"] == [seen, seen, 1.0, seen, 1.0]
    assert run.dispatch.log == []


def test_one_receiver_that_does_not_take_it_is_enough_to_end_the_run(tmp_path):
    run = looking(tmp_path, [0.1, 0.1, inf, 0.1, 0.1], infinite=(True, False))
    text = r'^plant\.y = inf at step 2: must be finite, or let it go on: diverging = "continue"$'
    with pytest.raises(SimulationError, match=text):
        run.to_the_end()
    assert run.signals()["plant.y"] == [0.1, 0.1, inf]


def test_no_number_ends_the_run_in_any_case(tmp_path):
    run = looking(tmp_path, [inf, 0.1, nan, 0.1, 0.1], diverging="continue")
    with pytest.raises(SimulationError, match=r"^plant\.y = nan at step 2: must be finite$"):
        run.to_the_end()


@pytest.mark.parametrize("value", [inf, nan])
def test_an_output_that_goes_nowhere_can_be_left_out_as_its_failure_says(tmp_path, value):
    mock = Mock(tmp_path, "plant", lambda u, t: value)
    system = make_system([mock], [], STEPS)
    with pytest.raises(SimulationError, match=r'no input: --record "(!plant\.y)" leaves it out$'):
        Run(system, [mock]).to_the_end()
    without = Run(system.with_record("!plant.y"), [mock])
    assert list(without.to_the_end()) == []


@pytest.mark.parametrize("gaps", [[inf] * 5, [0.1, 0.1, inf, inf, 0.1], [1e307] * 2 + [inf] * 3])
def test_a_run_that_is_to_go_on_does_so_with_inf_and_tells(tmp_path, gaps):
    run = looking(tmp_path, gaps, infinite=(False,), diverging="continue")
    assert run.to_the_end()["plant.y"] == gaps
    (line,) = run.dispatch.log
    assert line.startswith(f"plant.y ran away: inf at t = 0.{gaps.index(inf)}".rstrip("0."))


def test_only_outputs_that_go_somewhere_are_open_ended(tmp_path):
    system = looking(tmp_path, [0.1] * 5).master.system
    assert to_open_ends(system) == {Port("plant", "y")}
