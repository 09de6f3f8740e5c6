"""The step study of a system that is no grasp: of signals, of metrics, of what is neither."""

import math
from pathlib import Path

import pytest
from grasp_cosim import InputError, System, metric
from grasp_cosim.convergence.step_study import ask, step_study
from grasp_cosim.metrics.metric import Signals
from support.native_fmus import needs_gcc
from support.oscillator import write_oscillator
from support.slow import slow

pytestmark = needs_gcc

END = 0.64
"""s; where a.x = sin(t) and b.x = 1 - cos(t) in continuous time."""

EXACT = {"a.x": math.sin(END), "b.x": 1.0 - math.cos(END)}


@pytest.fixture
def oscillator(tmp_path: Path) -> System:
    return System.load(write_oscillator(tmp_path))


@metric("amplitude", unit="m")
def amplitude(run: Signals) -> float:
    """Of the oscillation, which is 1 m: from position and speed at the end."""
    return math.hypot(float(run["a.x"][-1]), 1.0 - float(run["b.x"][-1]))


@metric("both", unit="m")
def both(run: Signals) -> list[float]:
    return [float(run[f"{name}.x"][-1]) for name in ("a", "b")]


@metric("phase", unit="rad")
def phase(run: Signals) -> float:
    return math.asin(float(run["a.x"][-1]))


@metric("broken", unit="m")
def broken(run: Signals) -> float:
    raise ValueError("no good")


@pytest.mark.parametrize(
    ("scheme", "orders"), [("sequential", (2.0, 1.0)), slow("jacobi", (1.0, 1.0))]
)
def test_signals_tend_to_the_solution_in_continuous_time(
    oscillator: System, scheme: str, orders: tuple[float, float]
) -> None:
    """In sequence the position lags half a step behind the speed, which leaves no first order."""
    system = oscillator.with_experiment(scheme=scheme)
    study = step_study(system, 5e-3, of=("a.x", "b.x"), workers=1)
    assert (study.unit, study.quantities) == ("m", ("a.x", "b.x"))
    assert [run.step for run in study.runs] == [0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32]
    assert list(study.limits) == ["a.x", "b.x"]
    for (name, exact), order in zip(EXACT.items(), orders, strict=True):
        assert study.limits[name].limit == pytest.approx(exact, abs=2e-5)
        assert study.limits[name].order == pytest.approx(order, abs=0.2)
    apart = [max(abs(run.values[n] - x) for n, x in EXACT.items()) for run in study.runs]  # type: ignore[operator]
    assert study.kept == tuple(error <= 5e-3 for error in apart)
    assert study.holds
    assert f"a.x and b.x within 5 mm is {1e3 * study.largest:g} ms" in study.as_text()  # type: ignore[operator]
    found = study.as_json()
    assert {found["units"][name] for name in ("tolerance", "limit", "value", "error")} == {"m"}
    assert found["runs"][0]["value"] == dict(study.runs[0].values)


@pytest.mark.slow
def test_a_metric_of_ones_own(oscillator: System) -> None:
    study = step_study(oscillator, 1e-2, of=("amplitude",), metrics=(amplitude,), workers=2)
    assert study.quantities == ("amplitude",)
    assert study.limits["amplitude"].limit == pytest.approx(1.0, abs=1e-4)
    assert study.limits["amplitude"].order == pytest.approx(1.0, abs=0.2)
    assert "amplitude: limit " in study.as_text()
    mixed = step_study(oscillator, 1e-2, of=("amplitude", "a.x"), metrics=(amplitude,))
    assert mixed.quantities == ("amplitude", "a.x")
    assert mixed.limits["amplitude"] == study.limits["amplitude"]


@pytest.mark.slow
def test_a_metric_of_several_values_that_it_does_not_name(oscillator: System) -> None:
    study = step_study(oscillator, 5e-3, of=("both",), metrics=(both,), workers=1)
    assert study.quantities == ("both[1]", "both[2]")
    assert study.limits["both[1]"].limit == pytest.approx(EXACT["a.x"], abs=2e-5)
    assert study.limits["both[2]"].limit == pytest.approx(EXACT["b.x"], abs=2e-5)


def test_a_time_has_a_tolerance_by_default(oscillator: System) -> None:
    assert ask(oscillator, ("a.now",)).tolerance == 1e-3
    assert ask(oscillator, ("a.now",), 0.5).tolerance == 0.5


@pytest.mark.slow
def test_a_metric_that_fails_is_one_line(oscillator: System) -> None:
    with pytest.raises(InputError, match=r"^metric 'broken': ValueError: no good$"):
        step_study(oscillator, 1.0, of=("broken",), metrics=(broken,), workers=1)


def test_an_unnamed_function_cannot_go_to_the_processes_of_the_runs(oscillator: System) -> None:
    nameless = metric("nameless", unit="m")(lambda _: 1.0)
    with pytest.raises(InputError, match=r"^metric 'nameless': cannot go to another process "):
        step_study(oscillator, 1.0, of=("nameless",), metrics=(nameless,))


def test_nothing_is_asked_of_it_by_default(oscillator: System) -> None:
    with pytest.raises(InputError) as caught:
        ask(oscillator)
    said = str(caught.value)
    assert said.startswith("oscillator.toml: nothing to study by default; name metrics or signals")
    assert "valid: a.y_Real, " in said
    assert said.endswith(", b.steps")
    assert "a.y_String" not in said


@pytest.mark.parametrize(
    ("of", "tolerance", "message"),
    [
        (("a.x", "a.now"), None, "a.x, a.now are in m, s; must be of one unit"),
        (("a.x", "phase"), None, "a.x, phase are in m, rad; must be of one unit"),
        (("a.x", "a.y_Real"), None, "a.x, a.y_Real are in no unit, m; must be of one unit"),
        (("a.x",), None, "tolerance: must be given for a.x, in m"),
        (("phase", "phase"), None, "tolerance: must be given for phase, phase, in rad"),
        (("a.y_Real",), None, "tolerance: must be given for a.y_Real, in its unit"),
        (("a.x",), 0.0, "tolerance = 0.0 m: must be a number greater than 0"),
        (("a.u_Real",), 1.0, "no metric or signal 'a.u_Real'; did you mean a.y_Real"),
        (("time_to_contact",), None, "no metric or signal 'time_to_contact'; valid: phase, a.y_R"),
        (("a.y_String",), None, "no metric or signal 'a.y_String'; valid: phase, a.y_Real, "),
    ],
)
def test_a_question_without_an_answer_is_one_line(
    oscillator: System, of: tuple[str, ...], tolerance: float | None, message: str
) -> None:
    with pytest.raises(InputError) as caught:
        ask(oscillator, of, tolerance, (phase,))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_force_of_the_grasp_needs_a_tolerance_in_newtons(grasp: System) -> None:
    with pytest.raises(InputError, match=r"^tolerance: must be given for plant.*\[1\], in N$"):
        ask(grasp, ("plant.contact_force[1]",))
    with pytest.raises(InputError, match=r"^tolerance: must be given for peak_contact_force, in N"):
        ask(grasp, ("peak_contact_force",))
    with pytest.raises(InputError, match=r"are in N, s; must be of one unit$"):
        ask(grasp, ("time_to_contact", "peak_contact_force"))
    asked = ask(grasp, ("peak_contact_force",), 0.5)
    assert asked.quantities == ("peak_contact_force[1]", "peak_contact_force[2]")
    assert (asked.unit, asked.tolerance) == ("N", 0.5)
