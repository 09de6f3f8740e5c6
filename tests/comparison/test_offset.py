"""By how much a clock is off is found to a part of a sample, or nothing is said to be found."""

from contextlib import suppress

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.comparison.offset import fit_offset, shifted
from grasp_cosim.comparison.side import Side


def wave(t):
    return np.sin(7.0 * t) * np.exp(-0.4 * t) + 0.3 * np.sin(1.3 * t)


def side(name, time, **signals):
    columns = {f"a.{key}": value for key, value in signals.items()}
    return Side(name, time, columns, dict.fromkeys(columns), {})


RUN_TIME = np.arange(0.0, 6.0, 2e-3)
RUN = side("run", RUN_TIME, x=wave(RUN_TIME), y=3.0 - 2.0 * wave(RUN_TIME + 0.5))


@pytest.mark.parametrize("offset", [0.0, 1.5, -0.377, 1000.0])
@pytest.mark.parametrize(("begin", "end"), [(0.0, 6.0), (1.0, 4.0), (3.5, 6.0)])
@pytest.mark.parametrize("step", [2e-3, 3.1e-3, 0.7e-3])
def test_it_is_what_has_to_be_added(offset, begin, end, step):
    seen = np.arange(begin, end, step)
    log = side("log", seen - offset, x=wave(seen), y=3.0 - 2.0 * wave(seen + 0.5))
    assert fit_offset(log, RUN) == pytest.approx(offset, abs=2e-5)
    assert shifted(log, 0.25).time[0] == seen[0] - offset + 0.25


def test_signals_that_do_not_change_or_that_one_has_alone_do_not_count():
    seen = np.arange(1.0, 4.0, 3e-3)
    flat, other = np.full(len(seen), 0.5), np.random.default_rng(1).normal(size=len(seen))
    log = side("log", seen - 0.2, x=wave(seen), y=flat, z=other, on=other > 0.0)
    run = side("run", RUN_TIME, **{n[2:]: c for n, c in RUN.signals.items()}, on=RUN_TIME > 3.0)
    assert fit_offset(log, run) == pytest.approx(0.2, abs=2e-5)
    with pytest.raises(InputError, match=r"^log: time.offset = 'fit': no signal that run has, too"):
        fit_offset(side("log", seen, y=flat, z=other), run)


@pytest.mark.parametrize(("share", "found"), [(0.3, True), (3.0, False)])
def test_it_is_believed_from_a_correlation_of_7_tenths_on(share, found):
    seen = np.arange(1.0, 5.0, 2e-3)
    values = wave(seen)
    noise = np.random.default_rng(2).normal(0.0, share * values.std(), len(seen))
    log = side("log", seen - 0.4, x=values + noise)
    if found:
        assert fit_offset(log, RUN) == pytest.approx(0.4, abs=5e-3)
    else:
        with pytest.raises(InputError, match=r"at no offset, the best correlation is 0\.[1-6]"):
            fit_offset(log, RUN)


@pytest.mark.parametrize(("seconds", "enough"), [(1.6, False), (2.2, True)])
def test_a_third_of_the_shorter_one_has_to_overlap(seconds, enough):
    """Here the log, of 6 s, of which the run has seen so many."""
    rng, step = np.random.default_rng(3), 5e-3
    known = np.arange(0.0, 6.0, step)
    seen = np.arange(6.0 - seconds, 12.0 - seconds, step)
    values = np.cumsum(rng.normal(size=len(known) + len(seen)))
    log = side("log", seen - 50.0, x=values[len(known) - round(seconds / step) :][: len(seen)])
    run = side("run", known, x=values[: len(known)])
    found = None
    with suppress(InputError):
        found = fit_offset(log, run)
    assert (found == pytest.approx(50.0, abs=2e-3)) is enough
