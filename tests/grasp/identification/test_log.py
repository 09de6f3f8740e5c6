"""Friction from a log: of our own simulation with noise, and of a model that scipy integrates."""

import zipfile
from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError, simulate
from grasp_cosim.grasp.identification.identification import (
    GROUPS_OF_A_LOG,
    identify,
    parameters_of,
)
from grasp_cosim.grasp.identification.momentum_balance import identify_from_log
from grasp_cosim.metrics.metric import Signals
from grasp_cosim.recording.read_back import load_log
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
    parameters = parameters_of(groups or ("coulomb", "viscous"), GROUPS_OF_A_LOG, "test")
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


def test_the_friction_of_the_inner_part_comes_back(grasp):
    """Of a left finger that gets beyond 20 mm before the middle; positions must be there."""
    true = {"plant.friction.coulomb[2]": 0.6, "plant.friction.inner[2]": 0.7}
    place = {"plant.friction.inner_begin[2]": -0.02, "plant.initial_object_position": 0.05}
    system = grasp.with_values(place)
    result = simulate(system.with_values(true), step=1e-3, stop=2.5)
    log = Signals(result.time, dict(result.signals))
    found = identified(system, log, "inner[2]", "coulomb[2]")
    assert {e.name: e.value for e in found.estimates} == pytest.approx(true, rel=5e-3)
    blind = {name: column for name, column in log.by_name.items() if ".position" not in name}
    with pytest.raises(InputError, match=r"no signal 'plant\.position\[2\]'"):
        identified(system, replace(log, by_name=blind), "inner[2]")


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
    groups = "coulomb", "static", "viscous", "stribeck"
    found = {e.name: e.value for e in identified(grasp, log, *groups).estimates}
    assert found["plant.friction.static[1]"] == pytest.approx(1.0, rel=0.02)
    assert found["plant.friction.stribeck_velocity"] == pytest.approx(0.04, rel=0.02)


DRIVEN = {
    "plant.finger_mass[1]": 0.7,
    "plant.finger_mass[2]": 0.4,
    "drive.gain[1]": 0.8,
    "drive.gain[2]": 1.2,
    "drive.delay": 0.004,
    **TRUE,
}


def driven_log(*known):
    """Fingers of other masses, whose drives are late and too weak or too strong, in scipy."""
    true = {name: value for name, value in DRIVEN.items() if not name.startswith(known)}
    time = np.arange(0.0, 4.0, 1e-3)
    signals = {}
    for j, way in ((1, -1.0), (2, 1.0)):
        c, b = (TRUE[f"plant.friction.{n}[{j}]"] for n in ("coulomb", "viscous"))
        mass, gain = true.get(f"plant.finger_mass[{j}]", MASS), true.get(f"drive.gain[{j}]", 1.0)
        late = true.get("drive.delay", 0.0)

        def command(t, c=c, gain=gain):
            return (c + 1.5 + 0.9 * np.sin(9.0 * t) + 0.4 * np.sin(21.0 * t)) / gain

        held = command(time)

        def slope(t, x, held=held, late=late, mass=mass, gain=gain, c=c, b=b):
            u = gain * held[max(int((t - late) / 1e-3 + 1e-9), 0)]
            return [x[1], (u - c - b * x[1]) / mass]

        solution = solve_ivp(
            slope, (0.0, time[-1]), [0.0, 0.05], t_eval=time, rtol=1e-8, max_step=5e-4
        )
        signals[f"plant.position[{j}]"] = way * solution.y[0]
        signals[f"plant.velocity[{j}]"] = way * solution.y[1]
        signals[f"controller.force[{j}]"] = way * held
    return Signals(time, signals), true


@pytest.mark.slow
@pytest.mark.parametrize(
    ("known", "groups"),
    [
        ("drive.gain", ("coulomb", "viscous", "mass", "delay")),
        ("plant.finger_mass", ("coulomb", "viscous", "gain", "delay")),
    ],
)
@pytest.mark.parametrize("measured", ["plant.velocity", "plant.position"])
def test_masses_gains_and_the_delay_of_the_drives_come_back(grasp, known, groups, measured):
    """Of the velocity, or of the position alone, with noise; there is no contact force."""
    log, true = driven_log(known)
    other = {"plant.velocity", "plant.position"} - {measured}
    kept = {n: v for n, v in log.items() if not n.startswith(tuple(other))}
    noise = {"plant.velocity": 1e-4, "plant.position": 2e-7}[measured]
    random = np.random.default_rng(1)
    kept = {
        n: v + random.normal(0.0, noise, len(v)) if n.startswith(measured) else v
        for n, v in kept.items()
    }
    found = identified(grasp, Signals(log.time, kept), *groups)
    assert len(found.estimates) == 7
    for e in found.estimates:
        assert e.value == pytest.approx(true[e.name], rel=0.05, abs=3e-4), e.name


def test_mass_and_gain_cannot_be_told_apart(grasp, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,plant.velocity[1]\n0,0\n")
    with pytest.raises(InputError, match="only the ratio of the two; must be one of them"):
        identify(path, fit=("mass", "gain"), system=grasp)


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
    windows, _ = identify_from_log(
        grasp, gone, parameters_of(["coulomb"], GROUPS_OF_A_LOG, "test"), "test"
    )
    for w in windows:
        assert not ((w.begin > recorded.time[100] - 0.021) & (w.begin < recorded.time[100])).any()
        assert (w.begin > recorded.time[400]).any()
    for e in identified(grasp, gone).estimates:
        assert e.value == pytest.approx(TRUE[e.name], rel=5e-3, abs=5e-3), e.name


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("log.txt", b"time\n", "must be a .csv, .tsv, .mf4, .arrow, .feather, .parquet file"),
        ("log.csv", b"time,a\n0.0\n", "line 2 has 1 cell; must have 2, as line 1"),
        ("log.csv", b"t,a\n0,0\n", "no column of the name 'time'; must be one, in s or as in"),
        ("log.csv", b"time,Time [ms],a\n0,0,0\n", "2 columns of the name 'time'; must be one"),
        ("log.csv", b"time [V],a\n0,0\n", "'time .V.': must be in a unit of time, like ms"),
        ("log.csv", b"time,a\n", "has no row below its names; must have one"),
        ("log.parquet", b"PAR1 and no more", "is damaged, or no Parquet file: "),
        ("log.mf4", b"not an MDF file at all", "is damaged, not an MDF file"),
    ],
)
def test_a_file_that_is_no_log_is_refused(tmp_path, name, content, message):
    if name.endswith("mf4"):
        pytest.importorskip("asammdf")
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow")
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        load_log(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_file_without_contact_forces_is_that_of_free_fingers(grasp, recorded, tmp_path):
    """Up to 1 s, when no finger of the recorded grasp touches."""
    used = [f"{name}[{j}]" for name in ("plant.velocity", "controller.force") for j in (1, 2)]
    free = recorded.time < 1.0
    columns = [recorded.time[free], *(recorded[name][free] for name in used)]
    rows = [",".join(repr(float(cell)) for cell in row) for row in zip(*columns, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join([",".join(["time", *used]), *rows, ""]))
    found = identified(grasp, load_log(tmp_path / "log.csv", lambda _: None))
    for e in found.estimates:
        assert e.value == pytest.approx(TRUE[e.name], rel=5e-3, abs=5e-3), e.name


def test_columns_that_nobody_uses_hold_whatever_they_like(grasp, recorded, tmp_path):
    """As a spreadsheet writes it: a mark of the byte order, semicolons, ms, words, empty cells."""
    units = {"velocity": (1e3, "mm/s"), "contact_force": (1.0, "N"), "force": (1e-3, "kN")}
    used = [f"plant.{n}[{j}]" for n in ("velocity", "contact_force") for j in (1, 2)]
    used += [f"controller.force[{j}]" for j in (1, 2)]
    scaled = [units[name.partition(".")[2].partition("[")[0]] for name in used]
    heads = [f"{name} [{unit}]" for name, (_, unit) in zip(used, scaled, strict=True)]
    lines = [";".join(["operator", "time [ms]", *heads, "note", "note", "temperature"])]
    columns = [factor * recorded[name] for name, (factor, _) in zip(used, scaled, strict=True)]
    for row, values in enumerate(zip(1e3 * recorded.time, *columns, strict=True)):
        numbers = [repr(float(value)) for value in values]
        lines.append(";".join(["1st run", *numbers, "", "1_0", "21.5" if row else "n/a"]))
    (tmp_path / "log.csv").write_text("\n".join(lines), "utf-8-sig")
    told = []
    log = load_log(tmp_path / "log.csv", told.append)
    assert told == []
    for e in identified(grasp, log).estimates:
        assert e.value == pytest.approx(TRUE[e.name], rel=2e-3, abs=2e-3), e.name
    with pytest.raises(InputError, match=r"log.csv: line 2, column 11, temperature = 'n/a': must"):
        log["temperature"]
    with pytest.raises(InputError, match=r"column 10 = 'note': appears twice; must be"):
        log["note"]


def test_a_unit_of_something_else_is_refused(tmp_path):
    (tmp_path / "log.csv").write_text("time,plant.velocity[1] [N],x [N]\n0,1,2\n", "utf-8")
    said = r"column 2, plant.velocity\[1\] \[N\]: cannot be converted into m/s; must be a unit of"
    with pytest.raises(InputError, match=said):
        identify(tmp_path / "log.csv")


def test_what_a_log_is_taken_to_be_in_is_said(tmp_path):
    (tmp_path / "log.csv").write_text("time,a.x [mm],b,c [raw],d\n0,1,2,3,word\n", "utf-8")
    told = []
    log = load_log(tmp_path / "log.csv", told.append)
    assert (log["a.x"][0], log["b"][0], log["c"][0]) == (1e-3, 2.0, 3.0)
    assert [line.partition(": ")[2] for line in told] == [
        "b: no unit; taken to be in SI units",
        "c [raw]: not a known unit; taken to be in SI units",
    ]


def test_a_plant_that_knows_of_no_friction_of_the_inner_way(grasp, recorded, fmus, tmp_path):
    """One of a user, which has other friction parameters only."""
    theirs = tmp_path / "Theirs.fmu"
    with zipfile.ZipFile(fmus / "GripperPlant.fmu") as ours, zipfile.ZipFile(theirs, "w") as out:
        for name in ours.namelist():
            content = ours.read(name)
            if name == "modelDescription.xml":
                content = content.replace(b'"friction.inner', b'"friction.of_theirs')
            out.writestr(name, content)
    found = identified(grasp.swap("plant", theirs), recorded)
    assert found.estimates == identified(grasp, recorded).estimates
