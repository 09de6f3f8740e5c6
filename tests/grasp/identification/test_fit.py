"""The fit itself: estimates, intervals, what the data do not say."""

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError
from grasp_cosim.grasp.identification.fit import Parameter, fit

X = np.linspace(0.0, 2.0, 40)
SIGMA = 0.05


def parameter(name):
    return Parameter(name, "N", 1.0, 0.0, 10.0, 1.0)


def decay(a, b):
    return np.asarray(a * np.exp(-b * X))


def fitted(measured):
    chosen = [parameter("a"), parameter("b")]
    return fit(lambda points: [decay(x[0], x[1]) - measured for x in points], chosen, "test")


def test_the_intervals_hold_the_truth_as_often_as_they_say():
    noise = np.random.default_rng(1).normal(0.0, SIGMA, (120, len(X)))
    held = np.zeros(2)
    for row in noise:
        for i, (e, truth) in enumerate(
            zip(fitted(decay(3.0, 0.7) + row).estimates, (3.0, 0.7), strict=True)
        ):
            assert e.interval is not None
            held[i] += e.interval[0] <= truth <= e.interval[1]
    assert held / len(noise) == pytest.approx([0.95, 0.95], abs=0.06)  # 3 sigma of 120 draws


def test_the_intervals_are_those_of_scipy_curve_fit():
    from scipy.optimize import curve_fit
    from scipy.stats import t

    measured = decay(3.0, 0.7) + np.random.default_rng(2).normal(0.0, SIGMA, len(X))
    _, covariance = curve_fit(lambda x, a, b: a * np.exp(-b * x), X, measured, p0=[1.0, 1.0])
    half = t.ppf(0.975, len(X) - 2) * np.sqrt(np.diag(covariance))
    ours = [e.interval for e in fitted(measured).estimates]
    assert [0.5 * (i[1] - i[0]) for i in ours if i] == pytest.approx(half.tolist(), rel=0.02)


def test_a_parameter_at_its_bound_is_held_there_and_said_to_be():
    first, second = fitted(decay(3.0, -0.2)).estimates
    assert (second.value, second.interval) == (0.0, None)
    assert second.remark == "at its lower bound, held there"
    assert first.interval is not None


def test_of_two_that_act_alike_neither_is_determined():
    def residuals(points):
        return [(x[0] + x[1]) * X - 3.0 * X for x in points]

    found = fit(residuals, [parameter("a"), parameter("b")], "test")
    assert [e.interval for e in found.estimates] == [None, None]


def test_too_few_figures_are_refused():
    with pytest.raises(InputError, match=r"^test: 2 figures for 2 parameters; must be more$"):
        fit(lambda points: [np.zeros(2) for _ in points], [parameter("a"), parameter("b")], "test")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_residuals_that_are_not_finite_are_refused(value):
    measured = decay(3.0, 0.7)
    measured[7] = value
    with pytest.raises(InputError, match=r"^test: the residuals are not finite; must be") as caught:
        fitted(measured)
    assert "\n" not in str(caught.value)


def test_a_fit_that_does_not_come_to_rest_says_so(monkeypatch):
    monkeypatch.setattr("grasp_cosim.grasp.identification.fit.MAX_FIT_STEPS", 1)
    with pytest.raises(SimulationError, match="has not come to rest after 1 steps"):
        fitted(decay(3.0, 0.7))
