"""Margins against loops whose margins are known, and against python-control's."""

import math

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.linearisation.state_space import StateSpace


def model(a, b, c, d, step=0.01):
    a, b, c, d = (np.atleast_2d(np.asarray(m, float)) for m in (a, b, c, d))
    names = [
        tuple(f"{kind}{i}" for i in range(n))
        for kind, n in zip("xuy", (len(a), *d.T.shape), strict=True)
    ]
    return StateSpace(a, b, c, d, step, 0.0, *names)


def test_an_integrator_that_is_sampled_has_the_margins_of_its_formula():
    """-L = g / (z - 1): |z - 1| = 2 sin(w h/2), and z = -1 is where it is -g/2."""
    gain, step = 0.4, 0.01
    found = model(1.0, -gain, 1.0, 0.0, step).margins()
    crossover = 2.0 / step * math.asin(gain / 2.0)
    margin = math.pi / 2.0 - crossover * step / 2.0
    assert found.crossover == pytest.approx(crossover, rel=1e-9)
    assert found.phase_margin == pytest.approx(math.degrees(margin), rel=1e-9)
    assert found.delay_margin == pytest.approx(margin / crossover, rel=1e-9)
    assert found.gain_margin == pytest.approx(2.0 / gain, rel=1e-9)
    assert found.phase_crossover == pytest.approx(math.pi / step)
    assert found.stable


@pytest.mark.parametrize(("gain", "stable"), [(1.99, True), (2.01, False)])
def test_a_closed_loop_is_stable_up_to_its_gain_margin(gain, stable):
    assert model(1.0, -gain, 1.0, 0.0).margins().stable is stable


def test_a_constant_that_the_input_does_not_reach_makes_no_loop_unstable():
    found = model(np.diag([1.0, 1.0]), [[-0.4], [0.0]], [1.0, 1.0], 0.0).margins()
    assert found.stable


def test_a_loop_that_is_small_at_all_frequencies_has_no_crossover():
    found = model(0.5, -0.1, 1.0, 0.0).margins()
    assert math.isnan(found.crossover)
    assert found.phase_margin == found.delay_margin == math.inf
    assert found.gain_margin == pytest.approx(15.0)


def test_margins_are_of_one_input_and_one_output():
    with pytest.raises(InputError, match="2 inputs and 1 outputs; must be one input"):
        model(1.0, [[1.0, 2.0]], 1.0, [[0.0, 0.0]]).margins()


@pytest.mark.slow
def test_python_control_has_the_same_model_and_margins():
    control = pytest.importorskip("control")
    rng = np.random.default_rng(1)
    a = np.diag([0.99, 0.9, 0.7]) + np.triu(0.1 * rng.normal(size=(3, 3)), 1)
    found = model(a, -0.1 * rng.normal(size=(3, 1)), rng.normal(size=(1, 3)), 0.0)
    ss = found.ss()
    assert ss.dt == found.step
    assert ss.input_labels == ["u0"]
    omega = np.array([1.0, 30.0, 200.0])
    np.testing.assert_allclose(
        ss(np.exp(1j * omega * found.step)), found.frequency_response(omega)[:, 0, 0]
    )
    gain, phase, _, turn, crossover, _ = control.stability_margins(-ss)
    ours = found.margins()
    for mine, theirs in ((ours.phase_margin, phase), (ours.crossover, crossover)):
        if math.isfinite(theirs):
            assert mine == pytest.approx(theirs, rel=1e-6)
    if math.isfinite(gain) and gain > 1.0:
        assert ours.gain_margin == pytest.approx(gain, rel=1e-6)
        assert ours.phase_crossover == pytest.approx(turn, rel=1e-6)
