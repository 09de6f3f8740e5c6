"""Friction from a log: of our own simulation with noise, and of a model that scipy integrates."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError, simulate
from grasp_cosim.grasp.identification.identification import OF_A_LOG, chosen
from grasp_cosim.grasp.identification.log import identify_from_log
from grasp_cosim.metrics.metric import Signals
from grasp_cosim.recording.load import load_log
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


def test_static_friction_that_is_never_seen_is_not_determined(grasp, recorded):
    log = scipy_log(TRUE, 0.0, 0.01)
    found = {e.name: e for e in identified(grasp, log, "coulomb", "static").estimates}
    assert found["plant.friction.static[1]"].interval is None


@pytest.mark.parametrize("kind", ["signals.csv", "signals.mf4"])
def test_a_log_is_read_from_both_kinds_of_file(grasp, tmp_path, kind):
    if kind.endswith("mf4"):
        pytest.importorskip("asammdf")
    result = simulate(grasp, step=1e-3, stop=0.05)
    path = tmp_path / kind
    result.to_csv(path) if kind.endswith("csv") else result.to_mdf(path)
    log = load_log(path)
    assert log.time.tolist() == pytest.approx(result.time.tolist())
    assert log.by_name["plant.velocity[1]"].tolist() == result["plant.velocity[1]"].tolist()


def test_a_signal_that_is_missing_is_named(grasp, recorded):
    signals = {k: v for k, v in recorded.items() if k != "controller.force[2]"}
    with pytest.raises(
        InputError, match=r"^test: no signal 'controller.force\[2\]'; did you mean con"
    ):
        identified(grasp, replace(recorded, by_name=signals))


def test_a_log_in_which_a_finger_rests_is_refused(grasp, recorded):
    rest = np.zeros(len(recorded.time))
    signals = {**recorded.by_name, "plant.velocity[1]": rest}
    with pytest.raises(InputError, match=r"^test: finger 1 does not move freely for 0.02 s"):
        identified(grasp, replace(recorded, by_name=signals))


def test_a_log_that_is_too_coarse_is_refused(grasp, recorded):
    coarse = Signals(recorded.time[::20], {k: v[::20] for k, v in recorded.items()})
    with pytest.raises(InputError, match=r"^test: a sample every 0.02 s; must be at most every"):
        identified(grasp, coarse)


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_time_that_does_not_grow_is_refused(grasp, recorded, value):
    time = recorded.time.copy()
    time[50] = value
    with pytest.raises(InputError, match=r"^test: the time must be finite and grow from sample to"):
        identified(grasp, replace(recorded, time=time))


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
        ("no.csv", None, "no such log; must be a .csv or .mf4 file"),
        ("log.txt", b"time\n", "must be a .csv or .mf4 file"),
        ("log.csv", b"time,a\n0.0\n", "is damaged"),
        ("log.mf4", b"not an MDF file at all", "is damaged, not an MDF file"),
    ],
)
def test_a_file_that_is_no_log_is_refused(tmp_path, name, content, message):
    if name.endswith("mf4"):
        pytest.importorskip("asammdf")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        load_log(tmp_path / name)
    assert "\n" not in str(caught.value)
