"""Where the adaptive law is the published one, to the last bit."""

from dataclasses import replace

import pytest
from grasp_controller import adaptive, holding, reflectance_ratio
from grasp_controller import impact_reduction as layer_2
from grasp_controller import simultaneous_contact as layer_3
from hypothesis import given
from hypothesis import strategies as st
from support.approach import ANY_SAMPLES, H, approach, pairs, published, run
from support.marks import examples

SAMPLES = ANY_SAMPLES | st.builds(approach, pairs(0.1, 2.0), pairs(0.01, 0.1))

NEVER_HOLDS = holding.Params(squeeze=1e12)


@pytest.mark.parametrize(
    "learnt",
    [
        reflectance_ratio.Params(prior_deviation=0.0),
        reflectance_ratio.Params(limit=0.0),
    ],
)
@examples(30)
@given(SAMPLES, st.floats(1e-5, 1e-2))
def test_nothing_learnt_and_no_hold_is_eq_2(learnt, samples, h):
    p = adaptive.Params(reflectance=learnt, hold=NEVER_HOLDS)
    for (_, y), z in zip(run(p, samples, h), published(p, samples, h), strict=True):
        assert tuple(y)[: len(z)] == z
        assert y.reflectance_ratio == 1.0


@pytest.mark.parametrize("case", [0, 1])
@examples(30)
@given(SAMPLES, st.floats(1e-5, 1e-2))
def test_without_layer_3_it_is_the_published_law(case, samples, h):
    """All but f_s, which is put out though it acts on nothing; it learns nevertheless."""
    p = adaptive.Params(layer_3.Params(enabled=False), layer_2.Params(enabled=case == 1))
    for (_, y), z in zip(run(p, samples, h), published(p, samples, h), strict=True):
        ours = y._asdict()
        for name, value in z._asdict().items():
            assert name == "simultaneous_contact_force" or ours[name] == value


@pytest.mark.parametrize("alpha", [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)])
def test_a_blind_sensor_teaches_nothing(alpha):
    """Without light on one side it is the published law, which then turns to the other side."""
    dark = approach(alpha)
    p = adaptive.Params(hold=NEVER_HOLDS)
    trace = run(p, dark)
    assert all(y.reflectance_ratio == 1.0 for _, y in trace)
    assert [tuple(y)[:5] for _, y in trace] == [tuple(z) for z in published(p, dark, H)]


def test_with_what_is_learnt_it_is_another_law():
    """The properties above say something."""
    samples, p = approach((0.5, 1.0)), adaptive.Params()
    (_, y), z = run(p, samples)[-1], published(p, samples, 1e-2)[-1]
    assert y.simultaneous_contact_force != pytest.approx(z.simultaneous_contact_force, abs=0.1)
    free = replace(p, hold=NEVER_HOLDS)
    assert run(free, samples)[-1][1].reflectance_ratio == pytest.approx(0.5, rel=0.05)
