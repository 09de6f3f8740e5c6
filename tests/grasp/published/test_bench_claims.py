"""Each claim of the experiments can fail."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import pytest
from grasp_cosim.grasp.published.claims import check_claims
from grasp_cosim.grasp.published.compared import Evidence, Run, bench_rms, simulation_rms
from grasp_cosim.grasp.published.tables import Setting, published_rows

Judge = Callable[..., list[int]]

PUBLISHED = published_rows("experiment")
BROWN_WHITE = Setting(0.03, 0.86, 1.0)
BLACK = Setting(0.03, 0.57, 0.57)


@pytest.fixture
def runs():
    """The experiments as published, the colours alike; with what the tables do not tell."""
    times = {}
    for row in PUBLISHED:
        if row.finger and row.case:
            times.setdefault((row.setting, row.case), []).append(row.published)
    alike = {case: times[Setting(0.03), case] for case in (1, 2)}
    made = {
        (s, case): _run(s, case, (alike[case] if _coloured(s) else both)[:2])
        for (s, case), both in times.items()
    }
    for setting, _ in list(made):
        made[setting, 0] = _run(setting, 0, [0.1, 0.2])
    return made


def _coloured(s):
    return s.x_m == 0.03 and s.alpha_1 == s.alpha_2


def _run(setting, case, times):
    metrics = {
        "time_to_contact": times,
        "target_position": setting.x_m,
    }
    touch = (20.0, 40.0) if case == 0 else (2.0, 1.0)
    return Run(setting, case, metrics, (0.0, 0.0), 0.005, touch, None)


def changed(runs, setting, case, **metrics):
    run = runs[setting, case]
    return {**runs, (setting, case): replace(run, metrics={**run.metrics, **metrics})}


@pytest.fixture
def judge(grasp):
    """The numbers of the claims that fail."""

    def failing(runs, contact_times=0.2):
        evidence = Evidence(runs, PUBLISHED, (), {"contact_times": contact_times}, grasp)
        claims = check_claims("experiment", evidence)
        assert len(claims) == 7
        return [i for i, claim in enumerate(claims) if not claim["holds"]]

    return failing


def test_the_published_figures_hold_every_claim(judge, runs):
    assert judge(runs) == []


def test_contact_times_that_are_far_from_the_published_ones_fail(judge, runs):
    assert judge(runs, 0.3499) == []
    assert judge(runs, 0.3501) == [0]


def test_one_row_that_is_not_closer_together_fails(judge, runs):
    assert judge(changed(runs, Setting(0.0), 2, time_to_contact=[2.0, 2.5])) == [1]


def test_a_nearer_finger_that_does_not_wait_fails(judge, runs):
    assert judge(changed(runs, Setting(0.05), 2, time_to_contact=[1.30, 1.40])) == [2]


def test_a_contact_time_that_depends_on_the_colour_fails(judge, runs):
    """By a tenth of the mean of all colours, of either finger in either case."""
    for case, finger in product((1, 2), (0, 1)):
        times = runs[BLACK, case].times
        count = len({s for s, _ in runs if s.x_m == 0.03 and s.alpha_1 == s.alpha_2})
        limit = 0.1 * count / (count - 0.1)  # of the time itself, which is part of the mean
        for share, failing in ((0.999, []), (1.001, [3])):
            later = list(times)
            later[finger] *= 1.0 + share * limit
            assert judge(changed(runs, BLACK, case, time_to_contact=later)) == failing


def test_brown_and_white_far_apart_fails(judge, runs):
    assert judge(changed(runs, BROWN_WHITE, 2, time_to_contact=[2.0, 2.389])) == []
    assert judge(changed(runs, BROWN_WHITE, 2, time_to_contact=[2.0, 2.391])) == [4]


@pytest.mark.parametrize("case", [0, 1, 2])
def test_an_impact_in_the_wrong_case_fails(judge, runs, case):
    """The settled force, K_i·W/2 = 3.43 N, is between the two."""
    key = Setting(0.01), case
    wrong, right = (3.42, 3.44) if case == 0 else (3.44, 3.42)
    for forces, failing in (((wrong, right), [5]), ((right, wrong), [5]), ((right, right), [])):
        assert judge({**runs, key: replace(runs[key], touch_forces=forces)}) == failing


def test_a_target_that_stays_beside_the_centre_fails(judge, runs):
    for way in (1.0, -1.0):
        assert judge(changed(runs, Setting(0.04), 2, target_position=0.04 + 0.99e-4 * way)) == []
        assert judge(changed(runs, Setting(0.04), 2, target_position=0.04 + 1.01e-4 * way)) == [6]


def test_a_target_that_does_not_overshoot_fails(judge, runs):
    for overshoot, failing in ((1.01e-4, []), (0.99e-4, [6])):
        made = {**runs, (BLACK, 2): replace(runs[BLACK, 2], overshoot=overshoot)}
        assert judge(made) == failing


def test_where_colours_differ_the_target_may_stay_beside(judge, runs):
    assert judge(changed(runs, BROWN_WHITE, 2, target_position=0.025)) == []


def test_the_root_mean_squares_are_by_table_and_count_white_once(runs):
    def rms(off):
        published = PUBLISHED
        exact = [{"difference": off.get((r.condition, r.case, r.finger), 0.0)} for r in published]
        return bench_rms(published, exact)

    assert rms({(0.05, 1, 2): 0.8}) == pytest.approx(
        {
            "contact_times": 0.8 / 40**0.5,
            "equal_colours": 0.0,
            "mixed_colours": 0.0,
            "positions": 0.8 / 24**0.5,
            "time_differences": 0.0,
        }
    )
    assert rms({("white/white", 1, 2): 0.8})["contact_times"] == 0.0
    assert rms({("brown/white", 1, 2): 0.8})["mixed_colours"] == pytest.approx(0.8 / 8**0.5)
    assert rms({(0.02, 1, None): 0.8})["time_differences"] == pytest.approx(0.8 / 26**0.5)


def test_the_root_mean_squares_are_the_same_in_every_order():
    """Correctly rounded sums: sum() of 3.12 and later is not that of 3.11."""
    rows = [
        {"finger": finger, "difference": 0.1 * i, "difference_at_0.37_mm": 0.7 * i}
        for i in range(1, 40)
        for finger in (None, 1)
    ]
    assert simulation_rms([], rows) == simulation_rms([], rows[::-1])
