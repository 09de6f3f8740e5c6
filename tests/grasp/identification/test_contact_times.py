"""Friction from contact times: of our own simulation, and of one in continuous time."""

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.grasp.identification.contact_times import (
    RATIO,
    STEP,
    STOP,
    Contact,
    Grasp,
    contact_times,
    fit_contacts,
    identify_from_times,
    leave_rows_out,
    published_contacts,
    read_contacts,
    scatter,
)
from grasp_cosim.grasp.identification.identification import GROUPS, parameters_of
from grasp_cosim.grasp.published.published_figures import Setting
from support import continuous

TRUE = {"plant.friction.viscous[1]": 25.0, "plant.friction.viscous[2]": 8.0}
X_M = 0.02
Place = tuple[float, int]
"""x_m in m, and the case."""

GRASPS = ((X_M, 1), (X_M, 2))

Simulator = Callable[[Sequence[Grasp]], Iterable[Sequence[float]]]


def simulator(system, step):
    """Through the FMUs, in this process."""
    stepped = system.with_experiment(step=step, stop=STOP)
    return lambda grasps: [contact_times((stepped, g)) for g in grasps]


def contacts(times, grasps=GRASPS):
    return [
        Contact("", Setting(x_m), case, finger, time)
        for (x_m, case), both in zip(grasps, times, strict=True)
        for finger, time in enumerate(both, start=1)
    ]


def fitted(simulate, measured, group):
    return fit_contacts(measured, parameters_of([group], tuple(GROUPS), "test"), simulate)


@pytest.mark.slow
def test_our_own_friction_comes_back(grasp):
    """In Case 0, which is the quickest: the plant takes many small steps where surfaces rub."""
    grasps = ((X_M, 0), (0.05, 0))
    simulated = simulator(grasp, 5e-3)
    values = (("plant.friction.coulomb[1]", 0.5), ("plant.friction.coulomb[2]", 1.4))
    measured = contacts(simulated([Grasp(x, 1.0, case, values) for x, case in grasps]), grasps)
    found = fitted(simulated, measured, "coulomb")
    assert [e.value for e in found.estimates] == pytest.approx([0.5, 1.4], abs=2e-3)


@pytest.mark.slow
def test_the_friction_of_a_solution_in_continuous_time_comes_back(grasp):
    friction = tuple(TRUE.values())
    solved = [
        continuous.solve(continuous.Grasp(case=case, x_m=x_m, B=(friction[0], friction[1])), STOP)
        for x_m, case in GRASPS
    ]
    measured = contacts([[t or STOP for t in s.contact_time] for s in solved])
    found = fitted(simulator(grasp, STEP), measured, "viscous")
    for e in found.estimates:
        assert e.value == pytest.approx(TRUE[e.name], rel=0.02, abs=0.2)
        assert e.interval is not None
    assert found.rms < 2e-3  # s, which a contact time at STEP is off by


@pytest.mark.slow
def test_the_friction_of_the_inner_part_comes_back(grasp):
    """Of the left finger, which gets beyond the middle in the second grasp only."""
    grasps = ((X_M, 0), (0.06, 0))
    simulated = simulator(grasp, 5e-3)
    values = (("plant.friction.coulomb[2]", 0.5), ("plant.friction.inner[2]", 0.8))
    measured = contacts(simulated([Grasp(x, 1.0, case, values) for x, case in grasps]), grasps)
    parameters = parameters_of(["inner[2]", "coulomb[2]"], tuple(GROUPS), "test")
    assert [p.name for p in parameters] == [name for name, _ in values]
    found = fit_contacts(measured, parameters, simulated)
    assert [e.value for e in found.estimates] == pytest.approx([0.5, 0.8], abs=2e-3)


def test_rows_that_are_left_out_of_a_linear_model():
    """The residuals are those of the whole fit over 1 - H, with the hat matrix H of a row."""
    places = [(x, case) for x in (0.0, 0.01, 0.02, 0.03, 0.04) for case in (1, 2)]
    noise = np.random.default_rng(1).normal(2.0, 0.1, (len(places), 2))
    measured = contacts(noise.tolist(), places)
    group = ["coulomb"]
    design = np.array([[1.0, 50.0 * c.setting.x_m + 0.1 * c.finger * c.case] for c in measured])

    def simulate(grasps):
        both = []
        for g in grasps:
            a, b = (value for _, value in g.parameters)
            both.append([a + b * (50.0 * g.x_m + 0.1 * finger * g.case) for finger in (1, 2)])
        return both

    parameters = parameters_of(group, tuple(GROUPS), "test")
    wide = [p._replace(low=-100.0, high=100.0) for p in parameters]
    whole = fit_contacts(measured, wide, simulate)
    left_out = leave_rows_out(measured, wide, whole, simulate)
    hat = design @ np.linalg.pinv(design)
    for x in {c.setting.x_m for c in measured}:
        row = [i for i, c in enumerate(measured) if c.setting.x_m == x]
        expected = np.linalg.solve(np.eye(4) - hat[np.ix_(row, row)], whole.residuals[row])
        assert left_out[row] == pytest.approx(expected, abs=1e-6)


def test_equal_grasps_run_once():
    asked = []

    def simulate(grasps):
        asked.extend(grasps)
        return [[1.0 + dict(g.parameters)[RATIO] * g.ratio, 2.0] for g in grasps]

    colours = [Setting(0.03, 0.57, 0.57), Setting(0.03), Setting(0.03, 1.0, 0.86)]
    measured = [Contact("", s, 1, 1, 2.0 * s.alpha_2 / s.alpha_1) for s in colours]
    fitted(simulate, measured, "ratio")
    assert len(asked) == len(set(asked))
    assert {g.ratio for g in asked} == {1.0, 0.86}


def test_a_finger_that_does_not_touch_counts_at_the_end(grasp):
    short = grasp.with_experiment(step=1e-3, stop=0.2)
    assert contact_times((short, Grasp(0.03, 1.0, 1, ()))) == [STOP, STOP]


def test_a_grasp_that_is_refused_says_which(grasp):
    with pytest.raises(InputError, match=r"^x_m = 5 m, Case 1: plant: .*must fit between"):
        contact_times((grasp, Grasp(5.0, 1.0, 1, ())))


def test_the_published_contacts_are_40_and_none_is_there_twice():
    found = published_contacts()
    assert len(found) == 40
    assert len({(c.label, c.case, c.finger) for c in found}) == 40
    times = {(c.label, c.case, c.finger): c.time for c in found}
    assert times["x_m = 0.05 m", 1, 2] == 4.81
    assert times["black/black", 2, 1] == 2.01
    assert not any("white" in c.label for c in found)


def test_a_table_of_contact_times_is_read(tmp_path):
    path = tmp_path / "times.csv"
    path.write_text("\ufeffx_m, case,finger,time,alpha_1,alpha_2\n0.03,1,2,3.1, 1,0.86\n", "utf-8")
    assert read_contacts(path) == [Contact("x_m = 0.03 m", Setting(0.03, 1.0, 0.86), 1, 2, 3.1)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty; must have names in its first line"),
        ("x_m,case,finger\n0,1,1\n", "finger, without time; must be x_m, case, finger, time, and"),
        ("x_m,case,finger,time\n0,1,1,soon\n", "line 2, column 4, time = 'soon': must be a number"),
        ("x_m,case,finger,time\n0,1,1,\n", "line 2, column 4, time: missing; must be a number"),
        ("x_m,case,finger,time\n0,1,1\n", "line 2 has 3 cells; must have 4, as line 1"),
        ("x_m,case,finger,time\n0,1,1,2,9\n", "line 2 has 5 cells; must have 4, as line 1"),
        ("x_m,case,finger,time\n\n0,1,1,soon\n", "line 3, column 4, time = 'soon': must be a"),
        ("x_m [s],case,finger,time\n0,1,1,2\n", r"x_m \[s\]: cannot be converted into m; must"),
        ("x_m,case,finger,time\n", "has no line below its columns; must have contact times"),
        ("x_m,case,finger,time\nnan,1,1,2\n", "line 2: x_m = nan m, .*: must be finite"),
        ("x_m,case,finger,time,alpha_1\n0,1,1,2,inf\n", "alpha = inf, 1.*: must be finite"),
        ("x_m,case,finger,time\n0,1,1,2\n0,3,1,2\n", "line 3: case = 3: must be one of 0, 1, 2"),
        ("x_m,case,finger,time\n0,1,0,2\n", "line 2: finger = 0: must be one of 1, 2"),
        ("x_m,case,finger,time\n0,1,1,-1\n", "time = -1 s, .*: must be finite, the time greater"),
    ],
)
def test_a_wrong_table_is_one_line(tmp_path, text, message):
    path = tmp_path / "times.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_contacts(path)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_processes_give_the_same_fit(grasp):
    measured = contacts([[1.5, 3.2], [2.3, 2.5]])
    parameters = parameters_of(["stribeck"], tuple(GROUPS), "test")
    parallel = identify_from_times(grasp, measured, parameters, progress=False)
    here = fit_contacts(measured, parameters, simulator(grasp, STEP))
    assert parallel.residuals.tobytes() == here.residuals.tobytes()
    assert parallel.estimates == here.estimates
    assert parallel.estimates[0].remark == "the data do not determine it"  # without friction


def test_the_published_experiments_scatter():
    """Of the five equal colours, from the paper's table by hand: 0.036, 0.196, 0.140, 0.150 s."""
    by_hand = math.sqrt((0.036**2 + 0.196**2 + 0.140**2 + 0.150**2) / 4)
    assert scatter(published_contacts()) == pytest.approx(by_hand, abs=5e-4)
