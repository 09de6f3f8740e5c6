"""Parameters of the adaptive law that change between two steps."""

from dataclasses import replace

import pytest
from grasp_controller import adaptive, holding, reflectance_ratio
from grasp_controller.adaptive import Params
from support.approach import H, approach
from support.declared import parameters

PARTS = {"reflectance": reflectance_ratio.Params, "hold": holding.Params}

OTHERS = [
    (part, p.name, value)
    for part, block in PARTS.items()
    for p in parameters(block)
    if p.name != "diffusion_exponent"  # the one that does not change: y would be in another unit
    for value in (max(p.low, 0.3 * p.default), min(p.high, 3.0 * p.default), p.low, p.high)
]


def after_half(p):
    """Half an approach, and the samples of the rest."""
    samples = approach((0.5, 1.0))
    x = adaptive.initial_state(p, samples[0])
    for u in samples[1:60]:
        x = adaptive.step(p, x, u, H)
    return x, samples[59:]


def changed(part, name, value):
    return replace(Params(), **{part: replace(getattr(Params(), part), **{name: value})})


@pytest.mark.parametrize(("part", "name", "value"), OTHERS)
def test_no_change_makes_the_force_jump(part, name, value):
    """The new number acts on the virtual force from the next step on, and is felt behind it."""
    x, (u, *_) = after_half(Params())
    p = changed(part, name, value)
    assert adaptive.outputs(p, x, u).force == adaptive.outputs(Params(), x, u).force
    assert adaptive.outputs(p, x, u).reflectance_ratio == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(("part", "name", "value"), OTHERS)
def test_what_is_learnt_stays_bounded(part, name, value):
    p = changed(part, name, value)
    x, (_, *rest) = after_half(Params())
    for u in rest:
        x = adaptive.step(p, x, u, H)
        assert abs(x.estimate.beta) <= p.reflectance.limit
        assert 0.0 <= x.estimate.deviation <= p.reflectance.prior_deviation


@pytest.mark.parametrize("name", ["prior_deviation", "limit"])
def test_what_is_learnt_can_be_put_aside_and_taken_up_again(name):
    """Both lines go on meanwhile: the end is that of an approach without the change."""
    x, (_, *rest) = after_half(Params())
    z = x
    off = changed("reflectance", name, 0.0)
    for k, u in enumerate(rest):
        x = adaptive.step(Params(), x, u, H)
        z = adaptive.step(off if k < 20 else Params(), z, u, H)
        assert (z.estimate.beta == 0.0) == (k < 20)
    assert z.estimate == pytest.approx(x.estimate, rel=1e-3)


def test_a_longer_low_pass_goes_on_from_where_it_was():
    """A sample counts by the share that the new time constant gives it."""
    x, (_, u, *_) = after_half(Params())
    slow = adaptive.step(changed("reflectance", "time_constant", 10.0), x, u, H)
    quick = adaptive.step(changed("reflectance", "time_constant", 1e-6), x, u, H)
    assert slow.line_1.intensity == pytest.approx(x.line_1.intensity, rel=1e-3)
    assert quick.line_1.intensity == pytest.approx(u.intensity[0], rel=1e-3)
