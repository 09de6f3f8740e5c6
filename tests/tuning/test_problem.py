"""Gains between bounds, and what a problem of tuning refuses."""

from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim import InputError
from grasp_cosim.tuning.problem import Gain
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.native_fmus import needs_gcc
from support.tuned import GAINS, known_problem


@pytest.mark.parametrize(
    ("low", "high", "middle"),
    [(1.0, 4.0, 2.0), (-4.0, -1.0, -2.0), (-1.0, 3.0, 1.0), (0.0, 5.0, 2.5)],
)
def test_bounds_of_one_sign_are_searched_by_the_logarithm(
    low: float, high: float, middle: float
) -> None:
    gain = Gain(("a.k",), low, high)
    assert [gain.at(u) for u in (0.0, 0.5, 1.0)] == [low, middle, high]
    assert [gain.share(v) for v in (low, middle, high)] == pytest.approx([0.0, 0.5, 1.0])
    assert gain.share(high + 1.0) == 1.0
    assert gain.share(low - 1.0) == 0.0


@given(
    st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)).filter(lambda b: b[0] < b[1]),
    st.floats(0.0, 1.0),
)
@examples()
def test_a_value_has_four_digits_or_is_a_bound(bounds: tuple[float, float], share: float) -> None:
    gain = Gain(("a.k",), *bounds)
    value = gain.at(share)
    assert bounds[0] <= value <= bounds[1]
    assert value in (*bounds, float(f"{value:.4g}"))


def test_what_a_user_would_write_comes_back_as_it_was() -> None:
    for value in (0.6, 25.0, 12.0, 98.0, 0.0024, 14.0):
        gain = Gain(("a.k",), value / 5.0, value * 5.0)
        assert gain.at(gain.share(value)) == value


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (2.0, 1.0, "a.k: bounds 2.0 to 1.0: must have the lower one first, and be finite"),
        (1.0, 1.0, "a.k: bounds 1.0 to 1.0: must have the lower one first, and be finite"),
        (-1e308, 1e308, "a.k: bounds -1e+308 to 1e+308: must have the lower one first"),
        (float("nan"), 1.0, "a.k: bound = nan"),
        (0.0, float("inf"), "a.k: bound = inf"),
    ],
)
def test_bounds_that_are_none_are_refused(low: float, high: float, said: str) -> None:
    with pytest.raises(InputError, match=r"^a\.k: ") as caught:
        Gain(("a.k",), low, high)
    assert str(caught.value).startswith(said)


@needs_gcc
def test_variables_of_one_gain_keep_their_ratio(tmp_path: Path) -> None:
    problem = known_problem(tmp_path, gains=[Gain(("a.gain", "a.u_Real"), 0.5, 8.0)])
    assert problem.start == (1.0,)
    assert problem.values((3.0,)) == {"a.gain": 3.0, "a.u_Real": 6.0}
    assert problem.unit(problem.gains[0]) is None


@needs_gcc
def test_what_does_not_fit_is_refused_before_any_run(tmp_path: Path) -> None:
    problem = known_problem(tmp_path)
    wrong = {
        "no gain to tune for; must be at least one": {"gains": ()},
        "no condition to tune for; must be at least one": {"conditions": ()},
        "no metric 'speed'; valid: slowness, effort": {"minimise": "speed"},
        "no metric 'speed'; valid: slowness, effort ": {"limits": {"speed": 1.0}},
        "limit slowness: is on what is to be least; must be on another": {
            "limits": {"slowness": 1.0}
        },
        "a.gain: is varied twice; must be there once": {"gains": (GAINS[0], GAINS[0])},
        "a.steps: is of type Integer; must be a Real": {"gains": (Gain(("a.steps",), 1.0, 2.0),)},
        "a.k: a.fmu has no variable 'k'; valid: ": {"gains": (Gain(("a.k",), 1.0, 2.0),)},
    }
    for said, change in wrong.items():
        with pytest.raises(InputError) as caught:
            replace(problem, **change)  # type: ignore[arg-type]
        assert str(caught.value).startswith(said.rstrip())
    still = problem.system.with_values({"a.gain": 0.0})
    both = (Gain(("a.gain", "a.u_Real"), 0.5, 8.0),)
    with pytest.raises(InputError, match=r"^a\.gain: starts at 0: no ratio of a\.u_Real to it$"):
        replace(problem, gains=both, conditions=(replace(problem.conditions[0], system=still),))
