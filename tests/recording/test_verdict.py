"""The verdict on a run, from figures of its proxies and its timing."""

from dataclasses import asdict, replace
from types import SimpleNamespace

import pytest
from grasp_cosim import simulate
from grasp_cosim.recording.read_back import load_run
from grasp_cosim.recording.verdict import judge
from grasp_cosim.report.run_report import page_html
from grasp_cosim.report.terminal import run_json, run_text
from grasp_cosim.system.parts import Acceptance, Condition, Limit, Port

QUIET = {
    "missed": 0, "implausible": 0, "trips": 0, "limited": 0, "lead": 0.0, "lost": [],
}  # fmt: skip
"""The figures of a proxy in a run of 1000 steps that nothing disturbed."""


def judged(*proxies, timing=None, exceeded=0, anew=0, **settings):
    figures = {f"p{i}": {**QUIET, **changed} for i, changed in enumerate(proxies)}
    return {c.name: c for c in judge(settings, 1000, figures, timing, exceeded, anew)}


def failed(criteria):
    return {name for name, c in criteria.items() if not c.passed}


def test_a_plain_simulation_is_not_judged():
    assert judged() == {}


def test_a_quiet_bench_passes():
    found = judged({}, {})
    assert failed(found) == set()
    assert len(found) == 8


@pytest.mark.parametrize(
    ("figures", "name", "measured"),
    [
        ({"lost": [0.5]}, "lost", 1.0),
        ({"missed": 11}, "missed", 1.1),
        ({"implausible": 11}, "implausible", 1.1),
        ({"trips": 1}, "trips", 1.0),
        ({"limited": 1}, "limited", 1.0),
        ({"lead": 0.11}, "lead", 0.11),
    ],
)
def test_what_a_bench_may_not_do(figures, name, measured):
    found = judged(figures, {})
    assert failed(found) == {name}
    assert found[name].measured == pytest.approx(measured)
    limits = {**asdict(Acceptance()), name: 1}
    assert failed(judged(figures, {}, acceptance=limits)) == set()


@pytest.mark.parametrize(
    ("overruns", "steps", "percent", "passed"),
    [(0, 200, 0.0, True), (2, 200, 1.0, True), (3, 200, 1.5, False), (0, 0, 0.0, True),
     (5, 0, 500.0, False)],
)  # fmt: skip
def test_overruns_are_a_share_of_the_steps_and_refusals_a_number(overruns, steps, percent, passed):
    timing = SimpleNamespace(overruns=overruns, steps=steps, refused=("a", "b"))
    found = judged({}, timing=timing)
    assert found["overruns"].measured == percent
    assert found["overruns"].passed is passed
    assert (found["overruns"].limit, found["overruns"].unit) == (1.0, "%")
    assert (found["refused"].measured, found["refused"].passed) == (2.0, False)
    assert "overruns" not in judged(timing=timing)
    assert judged(timing=timing)["refused"].measured == 2.0


def test_a_run_that_did_not_come_to_its_end_fails_unless_that_is_permitted():
    for permitted in (0, 1):
        settings = {"acceptance": {"unfinished": permitted}}
        criteria = judge(settings, 1000, {"p": QUIET}, None, 0, 0, finished=False)
        assert (criteria[0].name, criteria[0].measured) == ("unfinished", 1.0)
        assert criteria[0].passed is bool(permitted)


def test_the_worst_of_several_shares_counts_and_all_losses():
    found = judged({"missed": 8, "lost": [0.1]}, {"missed": 9, "lost": [0.2, 0.3]})
    assert (found["missed"].measured, found["lost"].measured) == (0.9, 3.0)


def test_a_loop_that_began_anew():
    assert failed(judged({}, anew=1)) == {"initialised_anew"}


def test_limits_that_were_exceeded():
    assert judged(limits=[{"when": "a.b > 1", "then": "warn"}])["warnings"].passed
    assert failed(judged(limits=[{}], exceeded=2)) == {"warnings"}


def test_a_line_says_what_how_much_and_where_the_limit_is_set():
    line = str(judged({"missed": 20})["missed"])
    assert line == "steps without an answer in time: 2 %; must be at most 1 % (verdict.missed)"


@pytest.fixture
def warned(grasp):
    """A run in which a limit is exceeded that warns."""
    limit = Limit(Condition(Port("plant", "gap[1]"), "<", 0.03), "warn")
    return replace(grasp.with_experiment(step=4e-3, stop=1.0), limits=(limit,))


def test_it_is_on_the_page_in_the_text_and_in_what_is_read_back(warned, tmp_path, run_of):
    result = run_of(warned, tmp_path)
    read = load_run(tmp_path)
    for found in (result, read):
        assert not found.passed
        (ended, criterion) = found.verdict
        assert (ended.name, ended.passed) == ("unfinished", True)
        assert (criterion.name, criterion.measured) == ("warnings", 1.0)
        assert found.limits[0].steps > 0
    page = page_html(read)
    assert "Test protocol" in page
    assert "Failed: limits that were exceeded." in page
    assert read.origin["fmus"]["plant"]["sha256"] in page
    assert "verdict               failed 1 of 2 criteria" in run_text(read)
    assert run_json(read)["verdict"] == [c.as_dict() for c in read.verdict]


@pytest.fixture
def run_of():
    """Runs a system into a folder."""
    from grasp_cosim.recording.folder import RunFolder

    def run(system, folder):
        with RunFolder(folder, system, ("test",)) as writer:
            return simulate(
                system, listeners=[writer], finish=lambda result, _: writer.finish(result)
            )

    return run
