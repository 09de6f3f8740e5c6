"""Whether a step is small enough: contact times against an independent solution, and verdicts."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from grasp_controller import series
from grasp_cosim import System, simulate
from grasp_cosim.convergence.extrapolation import Convergence, converge
from grasp_cosim.convergence.step_study import StepRun, StepStudy, ask, run_step, step_study
from grasp_cosim.errors import InputError, SimulationError
from grasp_cosim.grasp.metrics import FINGERS, first_contact
from grasp_cosim.metrics.metric import Signals
from gripper_plant import rigid
from proximity_sensor import optics
from support.continuous import Grasp, solve
from support.direct import closed_loop

MODULE = step_study.__module__

CONTACTS = ("time_to_contact[1]", "time_to_contact[2]")
"""What a study of a grasp asks about, by default."""

LIMIT_ERROR = 5e-6
"""s; what the extrapolation leaves from steps of 0.8 ms on: of second order, below 0.1 us from
steps of 0.1 ms on.
"""


@cache
def _exact() -> tuple[float, ...]:
    """s; the contact times of the built-in grasp, from equations in continuous time."""
    times = [t for t in solve(Grasp(), 3.0).contact_time if t is not None]
    assert len(times) == 2
    return tuple(times)


@cache
def _contact_times(step: float) -> tuple[float, ...]:
    """s; of the blocks called in order, without FMUs."""
    sensor = optics.Params()
    columns = closed_loop(
        rigid.Params(),
        (sensor, sensor),
        series.Params(),
        step,
        round(3.0 / step),
        until_contact=True,
    )
    signals = Signals(columns["time"], columns)
    contacts = [first_contact(signals, j) for j in FINGERS]
    return tuple(c[0] for c in contacts if c)


def _check_against_the_exact(found: Convergence, finger: int) -> None:
    assert found.limit == pytest.approx(_exact()[finger - 1], abs=LIMIT_ERROR)
    assert found.order is not None
    assert 0.8 <= found.order <= 1.2


@pytest.mark.parametrize("finger", FINGERS)
def test_the_limit_of_the_contact_times_is_the_continuous_solution(finger: int) -> None:
    """So small is the error of first order, 15 us per ms, that from 6 ms on others show."""
    steps = [4e-4, 8e-4, 1.6e-3, 3.2e-3]
    found = converge(steps, [_contact_times(h)[finger - 1] for h in steps])
    _check_against_the_exact(found, finger)
    assert found.settled == 4
    assert found.limit is not None
    assert found.uncertainty is not None
    assert abs(found.limit - _exact()[finger - 1]) < found.uncertainty


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_the_grasp_of_fmus_against_the_continuous_solution(grasp: System, scheme: str) -> None:
    """Jacobi adds a step of delay at each connection: larger errors, same order and limit."""
    system = grasp.with_experiment(step=1.6e-3, stop=2.0, scheme=scheme)
    study = step_study(system, tolerance=3e-3, steps=[4e-4, 8e-4, 3.2e-3], workers=1)
    assert tuple(study.limits) == study.quantities == CONTACTS
    for finger in FINGERS:
        _check_against_the_exact(study.limits[f"time_to_contact[{finger}]"], finger)
    errors = [
        [abs(t - exact) for t, exact in zip(_times(run), _exact(), strict=True)]
        for run in study.runs
    ]
    kept = [max(pair) <= 3e-3 for pair in errors]
    assert study.kept == tuple(kept)
    assert study.largest == max(
        run.step for run, good in zip(study.runs, kept, strict=True) if good
    )


def _times(run: StepRun) -> list[float]:
    return [t for t in run.values.values() if t is not None]


@pytest.mark.slow
def test_any_number_of_workers_gives_the_same_study(grasp: System) -> None:
    system = grasp.with_experiment(step=3.2e-3, stop=1.92)
    one, two = (step_study(system, workers=n, steps=[1.6e-3, 6.4e-3]) for n in (1, 2))
    assert one == two
    assert [run.step_ns for run in one.runs] == [1_600_000, 3_200_000, 6_400_000]
    assert all(len(_times(run)) == 2 for run in one.runs)


def _study(
    times: Sequence[tuple[float | None, float | None]], tolerance: float = 1e-3
) -> StepStudy:
    """A study of invented runs at 0.1, 0.2, 0.4 ms and so on; the system's own step is 0.2 ms."""
    runs = (
        StepRun(100_000 * 2**i, dict(zip(CONTACTS, pair, strict=True)), {})
        for i, pair in enumerate(times)
    )
    return StepStudy("hand.toml", "sequential", 3.0, 200_000, tolerance, "s", CONTACTS, tuple(runs))


def _linear(i: int, error: float = 1e-3) -> float:
    """s; a contact time at 1.5 s that errs by error in s at 0.4 ms, in proportion to the step."""
    return 1.5 + error * 2.0 ** (i - 2)


def test_the_largest_step_is_that_of_the_worse_finger() -> None:
    study = _study([(_linear(i, 0.3e-3), _linear(i, -0.9e-3)) for i in range(5)])
    assert study.kept == (True, True, True, False, False)
    assert study.largest == 4e-4
    assert study.holds
    assert "within 1 ms is 0.4 ms; the system's own, 0.2 ms, does" in study.as_text()
    assert study.as_text().count("out of tolerance") == 2


def test_a_step_of_its_own_that_is_too_long() -> None:
    study = _study([(_linear(i, 3e-3), None) for i in range(4)])
    assert study.largest == 1e-4
    assert not study.holds
    assert "time_to_contact[2]: has no value in any run" in study.as_text()
    assert study.as_text().endswith("the system's own, 0.2 ms, does not")


def test_no_step_is_short_enough() -> None:
    study = _study([(_linear(i, 30e-3), None) for i in range(4)])
    assert (study.largest, study.holds) == (None, False)
    assert "no step here keeps" in study.as_text()


def test_a_longer_step_that_is_right_by_chance_does_not_count() -> None:
    study = _study([*((_linear(i, 1.5e-3), None) for i in range(4)), (1.5, None)])
    assert study.kept == (True, True, False, False, True)
    assert study.largest == 2e-4


def test_a_run_without_a_contact_is_out_of_tolerance() -> None:
    study = _study([(_linear(i, 1e-5), _linear(i, 1e-5) if i < 3 else None) for i in range(5)])
    assert study.kept == (True, True, True, False, False)


def test_no_contact_at_all_is_nothing_to_judge() -> None:
    study = _study([(None, None)] * 4)
    assert (study.largest, study.holds, study.limits) == (None, False, {})
    assert "out of tolerance" not in study.as_text()
    assert study.as_text().endswith(
        "time_to_contact: no value until 3 s, nothing to judge; try a later --stop"
    )


def test_noise_is_called_noise() -> None:
    noise = np.random.default_rng(1).normal(1.5, 1e-3, 6)
    study = _study([(float(t), None) for t in noise])
    assert study.limits["time_to_contact[1]"].order is None
    assert "no whole order" in study.as_text()


def test_the_json_has_a_place_per_finger_and_per_run() -> None:
    study = _study([(_linear(i, 0.3e-3), None) for i in range(4)])
    first, second = CONTACTS
    found = study.as_json()
    assert (found["holds"], found["largest_step"], found["tolerance"]) == (True, 8e-4, 1e-3)
    assert [q["name"] for q in found["quantities"]] == [first]
    assert found["quantities"][0]["order"] == pytest.approx(1.0)
    assert found["quantities"][0]["limit"] == pytest.approx(1.5)
    last = found["runs"][-1]
    assert last["value"] == {first: _linear(3, 0.3e-3), second: None}
    assert last["error"] == {first: pytest.approx(0.6e-3), second: None}
    assert last["order"] == {first: pytest.approx(1.0), second: None}
    numbers = {*found, *found["quantities"][0], *last} - {
        "system", "scheme", "holds", "quantities", "runs", "units", "name", "order", "remark",
        "kept", "failure",
    }  # fmt: skip
    assert set(found["units"]) == numbers
    assert {found["units"][name] for name in ("tolerance", "value", "error", "step")} == {"s"}


def test_energies_are_shown_in_microjoules() -> None:
    study = _study([(_linear(i), None) for i in range(4)])
    energies = {"plant.exchange_energy[1]": 1.25e-6}
    study = replace(study, runs=tuple(replace(run, energies=energies) for run in study.runs))
    head, *lines = study.as_text().splitlines()[1:6]
    assert head.endswith("energy uJ: plant [1]")
    assert all(line.split()[4] == "1.25" for line in lines[:4])
    assert study.as_json()["runs"][0]["exchange_energy"] == energies


def test_the_energies_of_a_run_are_those_at_its_end(
    grasp: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = simulate(grasp, step=1e-3, stop=0.01)
    column = np.linspace(0.0, 1e-6, len(result.time))
    energies = {f"plant.exchange_energy[{j}]": j * column for j in (1, 2)}
    recorded = replace(result, signals={**result.signals, **energies})
    monkeypatch.setattr(f"{MODULE}.simulate", lambda system: recorded)
    run = run_step((grasp, ask(grasp)))
    assert run == StepRun(
        grasp.step_ns, dict.fromkeys(CONTACTS), {name: e[-1] for name, e in energies.items()}
    )


def test_a_run_that_breaks_off_is_a_finding(grasp: System, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(system: System) -> None:
        raise SimulationError("plant.gap[1] = nan at step 3: must be finite")

    monkeypatch.setattr(f"{MODULE}.simulate", breaks)
    run = run_step((grasp, ask(grasp)))
    assert run.failure == "plant.gap[1] = nan at step 3: must be finite"
    study = _study([(_linear(i, 1e-4), None) for i in range(4)])
    study = replace(study, runs=(*study.runs, replace(run, step_ns=1_600_000)))
    assert study.kept == (True, True, True, True, False)
    assert "failed: plant.gap[1] = nan" in study.as_text()


def test_an_interrupted_run_ends_the_study(grasp: System, monkeypatch: pytest.MonkeyPatch) -> None:
    result = simulate(grasp, step=1e-3, stop=0.01)
    monkeypatch.setattr(f"{MODULE}.simulate", lambda system: replace(result, complete=False))
    with pytest.raises(KeyboardInterrupt):
        run_step((grasp, ask(grasp)))


def _no_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The steps of the study without their runs."""
    monkeypatch.setattr(
        f"{MODULE}.run_all",
        lambda run, jobs, *_: [StepRun(system.step_ns, {}, {}) for system, _ in jobs],
    )


def test_the_steps_are_those_that_divide_the_stop_time(
    grasp: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    _no_runs(monkeypatch)
    study = step_study(grasp.with_experiment(step=1e-4, stop=3.0))
    assert [r.step for r in study.runs] == [2.5e-5, 5e-5, 1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3]


def test_the_steps_divide_those_of_the_components(
    grasp: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    _no_runs(monkeypatch)
    components = (*grasp.components[:3], replace(grasp.components[3], step_ns=200_000))
    study = step_study(replace(grasp, components=components))
    assert [r.step for r in study.runs] == [2.5e-5, 5e-5, 1e-4, 2e-4]


def test_steps_are_whole_nanoseconds(grasp: System, monkeypatch: pytest.MonkeyPatch) -> None:
    _no_runs(monkeypatch)
    study = step_study(grasp.with_experiment(step=1.5e-8, stop=1.2e-7))
    assert [r.step_ns for r in study.runs] == [15, 30, 60, 120]


@pytest.mark.parametrize("tolerance", [0.0, -1e-3, float("nan"), float("inf")])
def test_a_tolerance_must_be_positive(grasp: System, tolerance: float) -> None:
    with pytest.raises(InputError, match=r"tolerance = .* s: must be a number greater than 0"):
        step_study(grasp, tolerance)


def test_too_few_steps_are_refused(grasp: System) -> None:
    with pytest.raises(
        InputError, match=r"steps that fit the stop time: only 0.0001, 0.001 s; must"
    ):
        step_study(grasp, steps=[1e-3])


def test_a_given_step_that_does_not_fit_is_refused(grasp: System) -> None:
    with pytest.raises(InputError, match=r"step = 0.0007 s does not divide stop = 3 s"):
        step_study(grasp, steps=[7e-4, 1e-3, 2e-3])


def test_a_system_without_a_grasp_is_refused_by_name(grasp: System) -> None:
    sensor = replace(grasp.components[1], values={"gap": 0.1})
    system = replace(grasp, name="bench.toml", components=(sensor,), connections=())
    with pytest.raises(
        InputError,
        match=r"bench.toml: nothing .* valid: sensor_1.intensity$",
    ):
        step_study(system)
