"""The metrics of a grasp against solutions in closed form, and where there is nothing to tell."""

from math import cos, exp, pi, sin, sqrt

import numpy as np
import pytest
from grasp_cosim.grasp.metrics import IMPACT_WINDOW, METRICS, SETTLED, first_contact
from grasp_cosim.metrics.metric import Signals, measure
from scipy.optimize import brentq

OPENING = {1: 1.0, 2: -1.0}
SURFACE = 0.035
"""m; where the surface of the object is at first, on either side."""

MASS, STIFFNESS, DAMPING = 0.5, 1000.0, 10.0
SPEED, START = 0.3, 0.05001234
"""m/s and m of a finger that flies on to the surface."""


OF_FREE_FINGERS = {"remaining_gap", "smallest_gap"}
WARNINGS = {"sampling_energy"}
OF_OBJECT = {m.name for m in METRICS if m.optional} - WARNINGS


def grasp_metrics(time, signals):
    """The values of the metrics of a grasp, by name."""
    return measure(Signals(time, signals), METRICS).values


def recorded(time, finger, velocity, surface, force):
    """Two fingers, one the mirror image of the other; motions are in the opening direction."""
    x, v, s, f = (
        np.array([motion(t) for t in time]) for motion in (finger, velocity, surface, force)
    )
    signals = {
        "plant.object_position": np.zeros(len(time)),
        "controller.target_position": np.zeros(len(time)),
    }
    for j, side in OPENING.items():
        signals |= {
            f"plant.position[{j}]": side * x,
            f"plant.velocity[{j}]": side * v,
            f"plant.gap[{j}]": np.maximum(x - s, 0.0),
            f"plant.contact[{j}]": x <= s,
            f"plant.contact_force[{j}]": side * f,
        }
    return signals


def every(step, end):
    """Points in time."""
    return step * np.arange(round(end / step) + 1, dtype=np.float64)


def pressing(force, end, step=1e-3, touch=0.1004):
    """Fingers of 0.1 m/s touch, and a force of the time since then begins."""
    time = every(step, end)
    return time, recorded(
        time,
        lambda t: SURFACE + 0.1 * max(touch - t, 0.0),
        lambda t: -0.1 if t < touch else 0.0,
        lambda _: SURFACE,
        lambda t: force(t - touch) if t >= touch else 0.0,
    )


def pressed(force, end, step=1e-3, touch=0.1004):
    """The metrics of that."""
    return grasp_metrics(*pressing(force, end, step, touch))


def impact(step):
    """A mass that flies on to a Kelvin-Voigt surface and has not left it after the window."""
    touch, w, decay = (START - SURFACE) / SPEED, *oscillation()

    def depth(t):
        return SPEED / w * exp(-decay * t) * sin(w * t)

    def rate(t):
        return SPEED * exp(-decay * t) * (cos(w * t) - decay / w * sin(w * t))

    time = every(step, 0.09)
    return time, recorded(
        time,
        lambda t: START - SPEED * t if t < touch else SURFACE - depth(t - touch),
        lambda t: -SPEED if t < touch else -rate(t - touch),
        lambda _: SURFACE,
        lambda t: 0.0 if t < touch else STIFFNESS * depth(t - touch) + DAMPING * rate(t - touch),
    )


def oscillation():
    """Frequency in rad/s and decay in 1/s of the mass on the surface."""
    decay = 0.5 * DAMPING / MASS
    return sqrt(STIFFNESS / MASS - decay * decay), decay


def test_the_impulse_of_an_impact_is_the_momentum_that_it_takes():
    w, decay = oscillation()
    t = IMPACT_WINDOW
    left = SPEED * exp(-decay * t) * (cos(w * t) - decay / w * sin(w * t))
    metrics = grasp_metrics(*impact(1e-4))
    assert metrics["impact_impulse"] == pytest.approx([MASS * (SPEED - left)] * 2, rel=2e-5)
    assert metrics["impact_velocity"] == pytest.approx([SPEED] * 2, rel=1e-9)
    assert metrics["time_to_contact"] == pytest.approx([(START - SURFACE) / SPEED] * 2, abs=1e-9)


def test_the_impulse_errs_in_proportion_to_the_square_of_the_step():
    """Though the force begins with a jump between two samples."""
    w, decay = oscillation()
    t = IMPACT_WINDOW
    exact = MASS * SPEED * (1.0 - exp(-decay * t) * (cos(w * t) - decay / w * sin(w * t)))
    for step in (4e-3, 1e-3, 2.5e-4, 6.25e-5):
        found = grasp_metrics(*impact(step))["impact_impulse"][0]
        steepest = SPEED * (STIFFNESS + DAMPING * DAMPING / MASS)  # N/s, of the force
        assert abs(found - exact) < steepest * step * step


@pytest.mark.parametrize("zeta", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_a_step_response_of_second_order(zeta):
    w_0, steady = 40.0, 3.0
    w = w_0 * sqrt(1.0 - zeta * zeta)

    def off(t):
        return exp(-zeta * w_0 * t) * (cos(w * t) + zeta * w_0 / w * sin(w * t))

    metrics = pressed(lambda t: steady * (1.0 - off(t)), end=9.0)
    expected = exp(-pi * zeta / sqrt(1.0 - zeta * zeta))
    assert metrics["force_overshoot"] == pytest.approx([expected] * 2, abs=5e-4)
    # off(t) has its extremes at multiples of pi/w; the last one out of the band is known
    last = max(k for k in range(60) if k == 0 or exp(-zeta * w_0 * k * pi / w) > SETTLED)
    settled = brentq(lambda t: abs(off(t)) - SETTLED, last * pi / w, (last + 1) * pi / w - 1e-9)
    assert metrics["settling_time"] == pytest.approx([settled] * 2, abs=1e-4)
    assert metrics["steady_contact_force"] == pytest.approx([steady] * 2, rel=1e-9)


@pytest.mark.parametrize(
    "force",
    [
        lambda t: t,
        lambda t: 2.0 if t < 0.52 else 2.2,
        lambda t: 2.0 + 0.1 * sin(100.0 * t),
    ],
    ids=["still rising", "a step in the last 0.1 s", "an oscillation"],
)
def test_a_force_that_does_not_stay_has_not_settled(force):
    metrics = pressed(force, end=0.7)
    assert metrics["settling_time"] == [None, None]
    assert metrics["force_overshoot"][0] > 0.0


def test_a_finger_that_lets_go_in_the_end_has_no_steady_force_to_exceed():
    """The mean of the last 0.1 s is still one: 2 N for half of it."""
    metrics = pressed(lambda t: 2.0 if t < 0.85 else 0.0, end=1.0)
    assert metrics["steady_contact_force"] == pytest.approx([1.0] * 2, rel=0.03)
    assert metrics["force_overshoot"] == metrics["settling_time"] == [None, None]


def test_a_finger_that_never_touches():
    metrics = pressed(lambda _: 2.0, end=0.05)
    for name in (
        "time_to_contact", "impact_velocity", "impact_impulse", "force_overshoot", "settling_time",
    ):  # fmt: skip
        assert metrics[name] == [None, None]
    assert metrics["time_difference"] is None
    assert metrics["peak_contact_force"] == metrics["steady_contact_force"] == [0.0, 0.0]


def test_unequal_forces_differ_by_their_steady_parts():
    time, signals = impact(1e-3)
    at_rest = np.where(time < 0.02, 9.0, 2.0)
    held = {"plant.contact_force[1]": -at_rest, "plant.contact_force[2]": 0.0 * time + 2.5}
    longer = {name: np.concatenate((s, np.repeat(s[-1:], 200))) for name, s in signals.items()}
    longer |= {name: np.concatenate((s, np.repeat(s[-1:], 200))) for name, s in held.items()}
    metrics = grasp_metrics(every(1e-3, 1e-3 * (len(time) + 199)), longer)
    assert metrics["force_difference"] == pytest.approx(0.5, rel=1e-12)


def test_the_object_drifts_by_what_it_goes_in_the_end():
    time = every(1e-3, 0.5)
    _, signals = impact(1e-3)
    longer = {name: np.resize(s, len(time)) for name, s in signals.items()}
    longer["plant.object_position"] = np.where(time < 0.3, 0.03, 0.03 - 0.02 * (time - 0.3))
    assert grasp_metrics(time, longer)["object_drift"] == pytest.approx(0.02, rel=1e-9)
    short = {name: s[:90] for name, s in longer.items()}
    assert grasp_metrics(time[:90], short)["object_drift"] is None


def test_only_where_a_finger_never_touches_is_there_a_gap_that_remains():
    """Finger 1 comes as near as 2 mm and leaves; finger 2 touches."""
    time, signals = impact(1e-3)
    near = np.linspace(0.01, 0.002, len(time) // 2)
    away = np.linspace(0.002, 0.007, len(time) - len(near))
    never = np.zeros(len(time), bool)
    free = {"plant.gap[1]": np.concatenate((near, away)), "plant.contact[1]": never}
    metrics = grasp_metrics(time, signals | free)
    assert metrics["time_to_contact"][0] is None
    assert metrics["remaining_gap"] == [pytest.approx(0.007), None]
    assert metrics["smallest_gap"] == [pytest.approx(0.002), None]
    assert not OF_FREE_FINGERS & set(grasp_metrics(time, signals))


@pytest.mark.parametrize(
    ("step", "end", "there"),
    [
        (1e-3, 0.119, False),
        (1e-3, 0.122, True),
        (0.019, 0.95, True),
        (0.021, 1.05, False),
        (0.1, 5.0, False),
    ],
)
def test_an_impact_that_is_hardly_recorded_has_no_impulse(step, end, there):
    """Not to its end; or between two samples, of which the window begins 1 us before one."""
    touch = 0.1004 if step == 1e-3 else 10 * step - 1e-6
    metrics = pressed(lambda _: 2.0, end=end, step=step, touch=touch)
    assert metrics["impact_impulse"] == (
        pytest.approx([2.0 * IMPACT_WINDOW] * 2, rel=1e-9) if there else [None, None]
    )


@pytest.mark.parametrize(
    ("closing", "fleeing"),
    [(0.05, 0.0), (0.05, 0.03), (0.05, -0.02), (0.0, -0.02), (-0.01, -0.02)],
    ids=["fixed", "it flees", "it comes", "it meets a finger at rest", "it catches up"],
)
def test_the_speed_of_an_impact_is_relative_to_the_surface(closing, fleeing):
    """Both at an even speed, so the moment and the speed are exact."""
    time = every(1e-3, 2.0)
    signals = recorded(
        time,
        lambda t: SURFACE + 0.01003 - closing * t,
        lambda _: -closing,
        lambda t: SURFACE - fleeing * t,
        lambda _: 0.0,
    )
    metrics = grasp_metrics(time, signals)
    assert metrics["impact_velocity"] == pytest.approx([closing - fleeing] * 2, rel=1e-9)
    expected = 0.01003 / (closing - fleeing)
    assert metrics["time_to_contact"] == pytest.approx([expected] * 2, abs=1e-9)


def test_the_steps_of_the_plant_are_seen_at_any_of_its_outputs():
    """Finger 1 and its surface rest from the start but for one jump; finger 2 moves throughout."""
    time = every(1e-3, 0.5)
    signals = recorded(
        time,
        lambda _: SURFACE + 0.01,
        lambda _: 0.0,
        lambda t: SURFACE + (0.0 if t < 0.4 else 0.004 if t < 0.401 else 0.01),
        lambda _: 0.0,
    )
    signals["plant.position[2]"] = -0.1 + 0.01 * time
    found = first_contact(Signals(time, signals), 1)
    assert found is not None
    assert found.speed == pytest.approx(0.004 / 1e-3, rel=1e-9)


def test_fingers_that_touch_from_the_start():
    time = every(1e-3, 0.5)
    signals = recorded(time, lambda _: SURFACE, lambda _: 0.0, lambda _: SURFACE, lambda _: 1.5)
    metrics = grasp_metrics(time, signals)
    assert metrics["time_to_contact"] == metrics["settling_time"] == [0.0, 0.0]
    assert metrics["impact_velocity"] == [None, None]
    assert metrics["impact_impulse"] == pytest.approx([1.5 * IMPACT_WINDOW] * 2, rel=1e-12)


OF_FORCE = (
    "impact_impulse", "peak_contact_force", "steady_contact_force", "force_difference",
    "force_overshoot", "settling_time",
)  # fmt: skip
OF_CONTACT = (
    "time_to_contact", "time_difference", "impact_impulse", "force_overshoot", "settling_time",
)  # fmt: skip
OF_GAP = ("remaining_gap", "smallest_gap", "impact_velocity")
NO_CONTROLLER = 'no component is the controller; name it under [roles]: controller = "..."'


def lost(names, why):
    return f"no {', '.join(names)}: {why}"


@pytest.mark.parametrize(
    ("without", "missing", "others"),
    [
        ("plant.contact[", [], {}),
        ("plant.velocity", [], {}),
        ("plant.position", [], {}),
        ("plant.gap", [lost(OF_GAP, "plant lacks gap[1]")], {"time_to_contact": 0.101}),
        (
            "plant.gap[2]",
            [lost(OF_GAP, "plant lacks gap[2]")],
            {"time_to_contact": 0.101, "time_difference": 0.0006},
        ),
        ("plant.contact_force", [lost(OF_FORCE, "plant lacks contact_force[1]")], {}),
        (
            ("plant.gap", "plant.contact["),
            [
                lost(OF_CONTACT, "plant has none of gap[1], contact[1]"),
                lost(OF_GAP, "plant lacks gap[1]"),
            ],
            {},
        ),
        ("controller.", [lost(["target_position"], NO_CONTROLLER)], {}),
        (
            "plant.object",
            [lost(("object_shift", "object_drift"), "plant lacks object_position")],
            {},
        ),
    ],
)
def test_metrics_take_what_they_use(without, missing, others):
    """Of fingers that touch at 0.1004 s with 0.1 m/s, and press with 2 N from then on.

    Without a gap a contact begins with the sample that has it, at 0.101 s.
    """
    time, signals = pressing(lambda _: 2.0, end=0.5)
    left = {name: column for name, column in signals.items() if not name.startswith(without)}
    found = measure(Signals(time, left), METRICS)
    assert found.missing == tuple(missing)
    gone = {name for line in missing for name in line[3:].partition(":")[0].split(", ")}
    expected = {
        "time_to_contact": 0.1004, "time_difference": 0.0, "impact_velocity": 0.1,
        "impact_impulse": 2.0 * IMPACT_WINDOW, "peak_contact_force": 2.0,
        "steady_contact_force": 2.0, "force_difference": 0.0, "force_overshoot": 0.0,
        "settling_time": 0.0, "target_position": 0.0, "object_shift": 0.0, "object_drift": 0.0,
    } | others  # fmt: skip
    values = {name: np.max(value) for name, value in found.values.items()}
    assert values == pytest.approx({n: v for n, v in expected.items() if n not in gone}, abs=1e-9)


def test_a_plant_that_tells_its_gaps_alone():
    """That of finger 1 is 10.1 mm - 1 m/s² t², of which 2.0, 0.1 and -2.0 mm are left at 0.09, 0.10
    and 0.11 s: it closes at 190 mm/s, and is used up 0.1 / 190 s after 0.10 s.
    """
    time = every(0.01, 0.2)
    gaps = {"plant.gap[1]": 0.0101 - time * time, "plant.gap[2]": 0.005 + 0.01 * time}
    values = grasp_metrics(time, gaps)
    assert values == {
        "time_to_contact": [pytest.approx(0.1 + 0.1 / 190.0, abs=1e-9), None],
        "time_difference": None,
        "remaining_gap": [None, pytest.approx(0.007)],
        "smallest_gap": [None, pytest.approx(0.005)],
        "impact_velocity": [pytest.approx(0.19, abs=1e-9), None],
    }


def test_the_object_has_the_metrics_that_the_plant_has_outputs_for():
    time, signals = impact(1e-3)
    assert not OF_OBJECT & set(grasp_metrics(time, signals))
    tilt, never, once = (np.zeros(len(time)), *np.zeros((2, len(time)), bool))
    tilt[10:13], once[20] = (0.1, -0.3, 0.2), True
    moved = grasp_metrics(
        time, signals | {"plant.tilt": tilt, "plant.toppled": once, "plant.squeeze": tilt + 0.3}
    )
    assert moved["object_tilt"] == 0.3
    assert moved["squeeze"] == pytest.approx(0.5)
    assert moved["toppled"] is True
    assert "damaged" not in moved
    assert grasp_metrics(time, signals | {"plant.damaged": never})["damaged"] is False


def test_the_margins_of_a_lift_are_the_smallest_while_it_lasts():
    """Of a fingertip by what it carries, of both by what it takes not to slip."""
    time = every(1e-3, 0.003)
    signals = {
        "plant.friction_limit[1]": np.array([0.1, 3.0, 2.0, 0.1]),
        "plant.friction_limit[2]": np.array([0.1, 3.0, 1.0, 0.1]),
        "plant.tangential_force[1]": np.array([0.0, 1.0, 1.6, 0.0]),
        "plant.tangential_force[2]": np.array([0.0, -1.0, 1.0, 0.0]),
        "plant.load": np.array([0.0, 2.0, 4.0, 0.0]),
        "plant.peak_pressure": np.array([0.0, 10.0, 20.0, 20.0]),
    }
    margins = grasp_metrics(time, signals)
    assert margins["friction_margin"] == [1.25, 1.0]
    assert margins["lift_margin"] == 0.75
    assert margins["peak_pressure"] == 20.0
    signals |= {name: 0.0 * signals[name] for name in signals if "limit" not in name}
    margins = grasp_metrics(time, signals)
    assert margins["friction_margin"] == [None, None]
    assert margins["lift_margin"] is None


def test_every_metric_has_a_unit_and_a_label(snapshot):
    time, signals = impact(1e-3)
    outputs = (
        "tilt", "toppled", "squeeze", "damaged", "slip", "dropped", "peak_pressure", "load",
        "friction_limit[1]", "friction_limit[2]", "tangential_force[1]", "tangential_force[2]",
    )  # fmt: skip
    signals |= {f"plant.{output}": np.zeros(len(time)) for output in outputs}
    there = [m.name for m in METRICS if m.name not in OF_FREE_FINGERS | WARNINGS]
    assert list(grasp_metrics(time, signals)) == there
    shown = [f"{m.name}: {m.title}, {m.unit}, {m.display_unit}, {m.factor:.6g}" for m in METRICS]
    assert shown == snapshot
    assert len(OF_OBJECT) == 9
    assert {m.name for m in METRICS if m.reason} == OF_FREE_FINGERS | WARNINGS


def felt(time, moment, speed, impulse, impact):
    """What a plant tells of fingers that touch then, both alike; impulses as functions of time."""
    begun = time >= moment
    signals = {}
    for j, side in OPENING.items():
        signals |= {
            f"plant.contact_impulse[{j}]": side * np.array([impulse(t) for t in time]),
            f"plant.first_contact_time[{j}]": np.where(begun, moment - time[0], -1.0),
            f"plant.impact_velocity[{j}]": np.where(begun, speed, 0.0),
            f"plant.touched[{j}]": begun,
            f"plant.impact_impulse[{j}]": side * np.array([impact(t) for t in time]),
        }
    return signals


@pytest.mark.parametrize("start", [0.0, 7.0])
def test_a_contact_between_two_samples_is_that_of_the_plant(start):
    """A finger that bounces each 2 ms, seen each 4 ms: no sample has a gap of 0 or a force."""
    time = start + every(4e-3, 0.4)
    away = {f"plant.{name}[{j}]": np.zeros(len(time)) for name in ("contact_force", "contact")
            for j in OPENING}  # fmt: skip
    away |= {f"plant.gap[{j}]": np.full(len(time), 1e-5) for j in OPENING}
    moment = start + 0.0107

    def bounces(t):
        return 6e-3 * max(0.0, (t - moment) // 2e-3 + 1.0)

    values = grasp_metrics(
        time, away | felt(time, moment, 5e-3, bounces, lambda t: min(bounces(t), 0.06))
    )
    assert values["time_to_contact"] == pytest.approx([moment] * 2, rel=1e-12)
    assert values["impact_velocity"] == [5e-3] * 2
    assert values["impact_impulse"] == pytest.approx([0.06] * 2)
    assert values["steady_contact_force"] == pytest.approx([3.0] * 2)
    assert "remaining_gap" not in values
    assert values["peak_contact_force"] == [0.0, 0.0]


def test_a_plant_that_began_later_than_the_run_tells_no_time_of_it():
    """It was initialised again: its moment is none of the step that the samples show."""
    time, signals = pressing(lambda t: 3.0, 0.3)
    plain = grasp_metrics(time, signals)
    told = felt(time, 0.1004, 0.2, lambda t: 3.0 * max(0.0, t - 0.1004), lambda t: 0.06)
    for j in OPENING:
        told[f"plant.first_contact_time[{j}]"] -= 0.05 * (time >= 0.1004)
    assert grasp_metrics(time, signals | told)["time_to_contact"] == plain["time_to_contact"]
    assert grasp_metrics(time, signals | told)["impact_velocity"] == plain["impact_velocity"]
    for j in OPENING:  # and an impulse that falls is none
        told[f"plant.contact_impulse[{j}]"][-5:] = 0.0
    found = grasp_metrics(time, signals | told)["steady_contact_force"]
    assert found == plain["steady_contact_force"]


def test_an_impulse_needs_a_run_that_has_its_window():
    time, signals = pressing(lambda t: 3.0, 0.119)
    told = felt(time, 0.1004, 0.1, lambda t: 3.0 * max(0.0, t - 0.1004), lambda t: 0.05)
    assert grasp_metrics(time, signals | told)["impact_impulse"] == [None, None]


@pytest.mark.parametrize(("step", "share"), [(1e-3, None), (5e-3, 1.0 / 9.0)])
def test_energy_of_the_sampling_is_told_from_a_tenth_of_the_work_on(step, share):
    """A sampled spring: it creates k·dx^2/2 a step, of the work of k·x·dx of a way out."""
    stiffness, speed = 100.0, 1.0
    time = every(step, 0.05)
    x = speed * time
    signals = {}
    for j in OPENING:
        signals |= {
            f"plant.position[{j}]": x,
            f"controller.force[{j}]": -stiffness * x,
            f"plant.exchange_energy[{j}]": 0.5 * stiffness * (speed * step) ** 2
            * np.arange(len(time)),
        }  # fmt: skip
    values = grasp_metrics(time, signals)
    if share is None:
        assert "sampling_energy" not in values
    else:
        assert values["sampling_energy"] == pytest.approx([share] * 2, rel=1e-9)
