"""The delay: what comes out is what went in, at its moment; in short steps its mean is kept."""

from dataclasses import replace
from itertools import accumulate, pairwise

import pytest
from gripper_plant import command_delay, tandem
from gripper_plant.tandem import Inputs, Params
from gripper_plant.wrist import Wrist
from hypothesis import given
from hypothesis import strategies as st
from support.marks import examples

FIRST = 7.0
"""What has gone in for ever."""


def out_of(history, delay):
    """The values that come out and the moments until when, from those that go in for h each."""
    line, now, out = command_delay.first(FIRST, delay), 0.0, []
    for value, h in history:
        line = command_delay.entered(line, value, delay, h)
        for found, end in zip(line.value, line.end, strict=True):
            if end > 0.0:
                out.append((found, now + min(end, h)))
                if end >= h:
                    break
        now += h
        line = command_delay.later(line, h)
    return out


def expected(history, delay):
    moments = [0.0, *accumulate(h for _, h in history)]
    return [
        (FIRST, delay),
        *((v, t + delay) for (v, _), t in zip(history, moments[1:], strict=True)),
    ]


def at(signal, t):
    return next(value for value, until in signal if t < until)


def integral(signal, t):
    total, before = 0.0, 0.0
    for value, until in signal:
        total += value * (min(until, t) - min(before, t))
        before = until
    return total


VALUES = st.floats(-1.0, 1.0)
DELAYS = st.floats(0.01, 1.0)


def histories(shortest, longest):
    """Steps as shares of the delay."""
    return st.lists(st.tuples(VALUES, st.floats(shortest, longest)), min_size=1, max_size=150)


@examples(60)
@given(histories(command_delay.SHORTEST * 1.0000001, 3.0), DELAYS)
def test_every_change_comes_out_at_its_moment(shares, delay):
    """In any mixture of steps of a sixtieth of the delay or longer."""
    history = [(value, share * delay) for value, share in shares]
    found, wanted = out_of(history, delay), expected(history, delay)
    moments = [0.0, *(t for _, t in wanted)]
    stop = sum(h for _, h in history)
    for before, after in pairwise(moments):
        for t in (before + 1e-6 * delay, after - 1e-6 * delay):
            if before < t < min(after, stop):
                assert at(found, t) == at(wanted, t)


@examples(60)
@given(histories(1e-3, 3.0) | histories(1e-3, 0.02), DELAYS)
def test_the_mean_is_kept_in_any_steps(shares, delay):
    """What has come out so far is what went in, but for the part of two cells; and the whole of it
    in the end.
    """
    shares = [*shares, (0.0, 0.02), (0.0, 2.0)]
    history = [(value, share * delay) for value, share in shares]
    found, wanted = out_of(history, delay), expected(history, delay)
    stop = sum(h for _, h in history)
    assert found[-1][1] == pytest.approx(stop)
    cell = 2.0 * command_delay.SHORTEST * delay
    for k in range(1, 41):
        t = stop * k / 40
        assert abs(integral(found, t) - integral(wanted, t)) <= 2.0 * cell + 1e-12
    assert integral(found, stop) == pytest.approx(integral(wanted, stop), abs=1e-9)


@pytest.mark.parametrize("h", [1e-4, 3e-4, 1e-3, 7e-3, 0.05, 0.4])
def test_the_plant_does_at_the_delayed_moment_what_it_does_without(h):
    """A command that changes once, and the wrist as it was that long before."""
    p = Params(object_fixed=True, wrist=Wrist(delay=0.0173))
    direct = replace(p, wrist=Wrist())
    n = round(0.4 / h)
    x, z = tandem.initial_state(p, Inputs()), tandem.initial_state(direct, Inputs())
    u = Inputs(0.0, 0.02)
    for _ in range(n):
        x = tandem.step(p, x, u, h)
    if n * h > p.wrist.delay:
        z = tandem.step(direct, z, u, n * h - p.wrist.delay)
    assert x.body.wrist == pytest.approx(z.body.wrist, abs=1e-9)
    assert x.body.wrist[0] > 1e-3
