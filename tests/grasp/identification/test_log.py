"""Friction from a log: of our own simulation with noise, and of a model that scipy integrates."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError, simulate
from grasp_cosim.grasp.identification.identification import OF_A_LOG, chosen, identify_from_log
from grasp_cosim.metrics.metric import Signals
from grasp_cosim.recording.folder import load_log
from scipy.integrate import solve_ivp

MASS = 0.5
NOISE = 1e-4
"""m/s, of a sample of the velocity."""

TRUE = {
    "plant.friction.coulomb[1]": 0.6,
    "plant.friction.coulomb[2]": 1.3,
    "plant.friction.viscous[1]": 8.0,
    "plant.friction.viscous[2]": 3.0,
}


@pytest.fixture(scope="module")
def recorded(grasp):
    """A grasp of ours with friction, without noise."""
    values = {**TRUE, "controller.impact_reduction.enabled": True}
    result = simulate(grasp.with_values(values), step=1e-3, stop=2.5)
    return Signals(result.time, dict(result.signals))


def noisy(log, seed):
    random = np.random.default_rng(seed)
    return replace(
        log,
        by_name={
            name: column + random.normal(0.0, NOISE, len(column)) if ".velocity" in name else column
            for name, column in log.by_name.items()
        },
    )


def identified(grasp, log, *groups):
    parameters = chosen(groups or ("coulomb", "viscous"), OF_A_LOG, "test")
    return identify_from_log(grasp, log, parameters, "test")[1]


def scipy_log(friction, static, v_s):
    """Both fingers pushed to and fro by a force of their own, one way at a time."""
    time = np.arange(0.0, 4.0, 1e-4)
    signals = {}
    for j, way in ((1, -1.0), (2, 1.0)):
        c, b = (friction[f"plant.friction.{n}[{j}]"] for n in ("coulomb", "viscous"))
        force = c + static + 1.5 + 0.9 * np.sin(3.0 * time) + 0.4 * np.sin(7.0 * time)

        def slope(t, v, c=c, b=b, force=force):
            u = float(np.interp(t, time, force))
            rub = c + static * float(np.exp(-((v[0] / v_s) ** 2)) + 0.0) + b * v[0]
            return [(u - rub) / MASS]

        solution = solve_ivp(slope, (0.0, time[-1]), [0.01], t_eval=time, rtol=1e-8, max_step=0.01)
        signals[f"plant.velocity[{j}]"] = way * solution.y[0]
        signals[f"controller.force[{j}]"] = way * force
        signals[f"plant.contact_force[{j}]"] = np.zeros(len(time))
    return Signals(time, signals)


def held(found, true):
    """How many intervals hold the truth; all of them must be there."""
    intervals = {e.name: e.interval for e in found.estimates}
    return sum(i[0] <= true[name] <= i[1] for name, i in intervals.items() if i is not None)


def test_without_noise_the_friction_of_our_simulation_comes_back(grasp, recorded):
    found = identified(grasp, recorded)
    for e in found.estimates:
        assert e.value == pytest.approx(TRUE[e.name], rel=2e-3, abs=2e-3), e.name


def test_with_noise_the_intervals_hold_it(grasp, recorded):
    counts = [held(identified(grasp, noisy(recorded, seed)), TRUE) for seed in range(20)]
    assert sum(counts) / (20 * len(TRUE)) >= 0.88  # 95 % less 3 sigma of 80 intervals
    found = identified(grasp, noisy(recorded, 0))
    for e in found.estimates:
        assert e.value == pytest.approx(TRUE[e.name], rel=0.1), e.name


@pytest.mark.slow
def test_friction_of_a_model_that_scipy_integrates_comes_back(grasp):
    log = scipy_log(TRUE, 0.0, 0.01)
    for e in identified(grasp, log).estimates:
        assert e.value == pytest.approx(TRUE[e.name], rel=2e-3), e.name
    counts = [held(identified(grasp, noisy(log, seed)), TRUE) for seed in range(20)]
    assert sum(counts) / (20 * len(TRUE)) >= 0.88


def test_what_is_not_fitted_is_that_of_the_system(grasp):
    known = grasp.with_values({k: v for k, v in TRUE.items() if "viscous" in k})
    found = identified(known, scipy_log(TRUE, 0.0, 0.01), "coulomb")
    assert [e.value for e in found.estimates] == pytest.approx([0.6, 1.3], rel=2e-3)


def test_stribeck_friction_comes_back(grasp):
    log = scipy_log({**TRUE, "plant.friction.viscous[2]": 8.0}, 0.4, 0.04)
    found = {e.name: e.value for e in identified(grasp, log, *OF_A_LOG).estimates}
    assert found["plant.friction.static[1]"] == pytest.approx(1.0, rel=0.02)
    assert found["plant.friction.stribeck_velocity"] == pytest.approx(0.04, rel=0.02)


def without(log):
    return replace(log, by_name={k: v for k, v in log.items() if k != "controller.force[2]"})


def resting(log):
    rest = {"plant.velocity[1]": np.zeros(len(log.time))}
    return replace(log, by_name={**log.by_name, **rest})


def coarse(log):
    return Signals(log.time[::20], {k: v[::20] for k, v in log.items()})


def stuck(log, value=0.0):
    return replace(log, time=np.where(np.arange(len(log.time)) == 50, value, log.time))


def broken(log):
    force = np.where(log.time > 1.0, np.nan, log["controller.force[1]"])
    return replace(log, by_name={**log.by_name, "controller.force[1]": force})


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (without, r"^test: no signal 'controller.force\[2\]'; did you mean con"),
        (resting, r"^test: finger 1 does not move freely for 0.02 s"),
        (coarse, r"^test: a sample every 0.02 s; must be at most every 0.01 s"),
        (stuck, r"^test: the time must be finite and grow from sample to"),
        (lambda log: stuck(log, np.nan), r"^test: the time must be finite and grow from"),
        (lambda log: Signals(log.time[:1], {}), r"^test: 1 sample; must be at least two"),
        (broken, r"^test: controller.force\[1\] = nan at 1.001 s, one of 1500 such samples"),
    ],
)
def test_a_log_that_says_nothing_is_refused(grasp, recorded, spoil, said):
    with pytest.raises(InputError, match=said):
        identified(grasp, spoil(recorded))


def test_a_window_with_a_sample_missing_does_not_count(grasp, recorded):
    """Rows left out while a finger turned round would else look like one way throughout."""
    kept = np.ones(len(recorded.time), dtype=bool)
    kept[100:400] = False
    gone = Signals(recorded.time[kept], {k: v[kept] for k, v in recorded.items()})
    windows, _ = identify_from_log(grasp, gone, chosen(["coulomb"], OF_A_LOG, "test"), "test")
    for w in windows:
        assert not ((w.time > recorded.time[100] - 0.021) & (w.time < recorded.time[100])).any()
        assert (w.time > recorded.time[400]).any()
    for e in identified(grasp, gone).estimates:
        assert e.value == pytest.approx(TRUE[e.name], rel=5e-3, abs=5e-3), e.name


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("log.txt", b"time\n", "must be a .csv or .mf4 file"),
        ("log.csv", b"time,a\n0.0\n", "is damaged"),
        ("log.mf4", b"not an MDF file at all", "is damaged, not an MDF file"),
    ],
)
def test_a_file_that_is_no_log_is_refused(tmp_path, name, content, message):
    if name.endswith("mf4"):
        pytest.importorskip("asammdf")
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        load_log(tmp_path / name)
    assert "\n" not in str(caught.value)
