"""The verdict on a run, from figures of its proxies and its timing."""

from dataclasses import asdict, replace
from types import SimpleNamespace

import pytest
from grasp_cosim import InputError, System, metric, simulate
from grasp_cosim.recording.read_back import load_run
from grasp_cosim.recording.verdict import judge
from grasp_cosim.report.run_report import page_html
from grasp_cosim.report.terminal import run_json, run_text
from grasp_cosim.system.parts import Acceptance, Condition, Limit, MetricLimit, Port

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
    limits = {**asdict(Acceptance()), "metrics": {}, name: 1}
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


def limited(system, **limits):
    """A short run with limits of its metrics."""
    changes = {f"verdict.metrics.{name}": limit for name, limit in limits.items()}
    return simulate(system.with_experiment(step=1e-3).with_settings(changes))


@pytest.mark.parametrize(
    ("limits", "failures"),
    [
        ({"time_difference": 0.05, "object_drift": 1}, []),
        ({"time_difference": 0.01}, ["time difference: 0.01027 s; must be at most 0.01 s"]),
        ({"steady_contact_force.low": 3, "steady_contact_force.high": 3.388},
         ["steady contact force[1]: 3.389 N; must be from 3 N to 3.388 N"]),
        ({"steady_contact_force.low": 3.5},
         ["steady contact force[1]: 3.389 N; must be at least 3.5 N",
          "steady contact force[2]: 3.386 N; must be at least 3.5 N"]),
        ({"steady_contact_force[2]": "3.3"}, ["steady contact force[2]: 3.386 N; must be at most"
                                             " 3.3 N"]),
        ({"smallest_gap": 1}, ["smallest gap: no value; must be at most 1"]),
    ],
)  # fmt: skip
def test_a_metric_may_have_limits(grasp, limits, failures):
    """Then any run is judged; a metric without a value is beyond them."""
    result = limited(grasp, **limits)
    failed = [c for c in result.verdict if not c.passed]
    assert [str(c).partition(" (verdict.metrics.")[0] for c in failed] == failures
    assert result.verdict[0].name == "unfinished"
    assert result.passed == (not failures)


def test_a_verdict_prints_as_what_failed(grasp):
    result = limited(grasp, time_difference=0.01, object_shift=1)
    assert repr(result.verdict) == (
        "failed 1 of 3 criteria: time difference: 0.01027 s; must be at most 0.01 s "
        "(verdict.metrics.time_difference)"
    )
    assert repr(limited(grasp, object_shift=1).verdict) == "passed all 2 criteria"
    with pytest.raises(AssertionError, match=r"time difference: 0\.01027 s; must be"):
        assert result.passed, result.verdict


def test_limits_of_metrics_are_in_the_files_and_on_the_page(grasp, tmp_path):
    result = limited(grasp, **{"time_difference": 0.01, "peak_contact_force.low": 1})
    result.save(tmp_path)
    read = load_run(tmp_path)
    assert read.verdict == result.verdict
    assert read.settings["acceptance"]["metrics"] == {
        "time_difference": {"low": None, "high": 0.01},
        "peak_contact_force": {"low": 1.0, "high": None},
    }
    page = page_html(read)
    assert "Failed: time difference." in page
    assert "at least 1 N" in page
    assert run_json(read)["verdict"][1] == {
        "name": "metrics.time_difference",
        "what": "time difference",
        "limit": 0.01,
        "measured": read.metrics["time_difference"],
        "unit": "s",
        "passed": False,
    }


def test_a_metric_of_true_or_false_may_have_to_be_one_of_them(grasp):
    @metric("touched")
    def touched(run):
        """Whether a finger touches."""
        return bool(run["plant.contact[1]"].any())

    system = grasp.with_experiment(step=1e-3).with_settings({"verdict.metrics.touched": "false"})
    (_, criterion) = simulate(system, metrics=[touched]).verdict
    assert str(criterion) == "touched: 1; must be 0 (verdict.metrics.touched)"


def read(tmp_path, grasp, verdict):
    """The grasp as a file with these lines."""
    lines = [f"{c.source} -> {c.target}" for c in grasp.connections]
    fmus = [f'[components.{c.name}]\nfmu = "{c.fmu}"' for c in grasp.components]
    text = f'metrics = ["grasp"]\nconnections = {lines}\n[experiment]\nstep = 1e-3\nstop = 0.1\n'
    (tmp_path / "s.toml").write_text("\n".join([text, *fmus, verdict]), "utf-8")
    return System.load(tmp_path / "s.toml")


def test_a_file_has_them_as_numbers_or_with_both_ends(grasp, tmp_path):
    table = (
        '[verdict.metrics]\ntime_difference = 0.05\n"impact_velocity[1]" = { low = 0, high = 1 }'
    )
    system = read(tmp_path, grasp, table)
    assert system.verdict == Acceptance(
        metrics=(
            MetricLimit("time_difference", None, 0.05),
            MetricLimit("impact_velocity[1]", 0.0, 1.0),
        )
    )
    changed = system.with_settings({"verdict.metrics.impact_velocity[1].low": 0.5})
    assert changed.verdict.metrics[1] == MetricLimit("impact_velocity[1]", 0.5, 1.0)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("time_diference = 1", "s.toml: verdict.metrics: no metric 'time_diference'; did you mean "
         "time_difference"),
        ('time_difference = "x"', "s.toml: verdict.metrics.time_difference = 'x': must be the "
         "highest value, a finite number, or true or false"),
        ("time_difference = { hi = 1 }", "s.toml: verdict.metrics.time_difference: unknown entry "
         "'hi'; valid: high, low"),
        ("time_difference = { low = 2, high = 1 }", "s.toml: verdict.metrics.time_difference.high ="
         " 1: low = 2 must be at most high = 1"),
        ("time_difference = { low = true }", "s.toml: verdict.metrics.time_difference.low = True: "
         "must be a finite number"),
    ],
)  # fmt: skip
def test_a_limit_of_a_metric_that_cannot_be_is_refused(grasp, tmp_path, line, message):
    with pytest.raises(InputError) as caught:
        simulate(read(tmp_path, grasp, f"[verdict.metrics]\n{line}"))
    assert str(caught.value).startswith(message)
