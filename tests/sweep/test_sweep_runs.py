"""Whole studies in processes of their own: the same bytes, failures as rows."""

import json
from pathlib import Path

import pyarrow.parquet as pq  # type: ignore[import-untyped]
import pytest
from grasp_cosim import InputError, SimulationError
from grasp_cosim.sweep.run import Job, Task, run_job
from grasp_cosim.sweep.sweep import run_here, sweep
from support.made_studies import GRID, native_study, write_native
from support.native_fmus import needs_gcc

pytestmark = needs_gcc

FAILING = (
    f"{GRID}values = [1.0, 2.0, 3.0]\n"
    '[[parameters]]\nname = "error_at"\nvariables = ["a.error_at"]\nvalues = [1e9, 0.055]\n'
)
CRASHING = (
    f"{GRID}values = [3.0]\n"
    '[[parameters]]\nname = "crash_at"\nvariables = ["a.crash_at"]\nvalues = [1e9, 0.055, 1e8]\n'
)


@pytest.mark.slow
def test_the_bytes_are_those_of_any_number_of_workers(tmp_path: Path) -> None:
    study = native_study(write_native(tmp_path), FAILING)
    one, two = (sweep(study, tmp_path / str(n), workers=n) for n in (1, 2))
    assert one.outcomes == two.outcomes
    assert one.as_json() == {**two.as_json(), "folder": str(tmp_path / "1")}
    files = [(tmp_path / str(n) / "runs.parquet") for n in (1, 2)]
    assert files[0].read_bytes() == files[1].read_bytes()

    table = pq.read_table(files[0])
    assert table.column_names == ["index", "gain", "error_at", "a.x", "a.steps", "error"]
    rows = table.to_pylist()
    assert [row["index"] for row in rows] == list(range(6))
    assert [row["gain"] for row in rows] == [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]
    for row in rows[::2]:
        assert row["a.x"] == pytest.approx(0.2 * row["gain"], rel=1e-12)
        assert (row["a.steps"], row["error"]) == (10, None)
    for row in rows[1::2]:
        assert (row["a.x"], row["a.steps"]) == (None, None)
        assert "a: " in row["error"]
        assert len(row["error"].splitlines()) == 1
    assert one.failed == 3
    assert one.as_json()["first_error"] == rows[1]["error"]
    assert one.as_json()["units"] == {"a.x": study.variable("a.x").unit, "a.steps": None}
    bound = json.loads(table.schema.metadata[b"grasp_cosim"])
    assert bound == {"study": "study.toml", **study.identity}

    again = sweep(study, tmp_path / "1", workers=2)
    assert again.resumed == 6
    assert again.outcomes == one.outcomes


@pytest.mark.slow
def test_a_crash_takes_its_own_run_only(tmp_path: Path) -> None:
    done = sweep(native_study(write_native(tmp_path), CRASHING), tmp_path / "out", workers=1)
    before, crashed, after = (outcome.error for outcome in done.outcomes)
    assert before is after is None
    assert "the process of the run ended by signal" in str(crashed)
    assert done.table.numbers("a.x")[[0, 2]].tolist() == pytest.approx([0.6, 0.6])


def test_a_system_of_two_components_that_is_no_grasp(tmp_path: Path) -> None:
    """b integrates what a has integrated; of both the last values are kept, and nothing else."""
    write_native(tmp_path)
    text = (tmp_path / "system.toml").read_text()
    head, _, component = text.partition("[components.a]")
    second = component.replace("u_Real = 2.0, ", "").replace(", u_Real = 2.0", "")
    assert second != component
    (tmp_path / "system.toml").write_text(
        f'connections = ["a.x -> b.u_Real"]\n{head}[components.a]{component}[components.b]{second}'
    )
    study = native_study(tmp_path, GRID.replace("a.steps", "b.x") + "values = [1.0, 2.0]\n")
    done = sweep(study, tmp_path / "out", workers=1)
    assert done.failed == 0
    assert [set(outcome.metrics) for outcome in done.outcomes] == [{"a.x", "b.x"}] * 2
    once, twice = done.table.numbers("b.x")
    assert 0.0 < 2.0 * once == pytest.approx(twice)


def test_a_run_that_is_refused_is_a_row(tmp_path: Path) -> None:
    study = native_study(write_native(tmp_path), FAILING)
    task = Task(study.system, study.outputs)
    outcome = run_job(task, Job(4, {"a.gain": "much"}))
    assert (outcome.index, outcome.metrics) == (4, {})
    assert "gain = 'much': must be" in str(outcome.error)


@pytest.mark.slow
def test_a_process_that_does_not_start_ends_the_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = native_study(write_native(tmp_path), FAILING)
    monkeypatch.setattr("grasp_cosim.parallel._work", _does_not_start)
    with pytest.raises(SimulationError, match="did not start: it ended with exit code 7"):
        list(run_here(Task(study.system, study.outputs), [Job(0, {})], 1))


def _does_not_start(*_: object) -> None:
    raise SystemExit(7)


def test_no_workers_are_no_workers(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="workers = 0: must be at least 1"):
        sweep(native_study(write_native(tmp_path), FAILING), tmp_path / "out", workers=0)


def test_what_a_kill_left_of_its_files_is_removed(tmp_path: Path) -> None:
    study = native_study(write_native(tmp_path), f"{GRID}values = [1.0]\n")
    (tmp_path / "out").mkdir()
    for name in ("runs.parquet.7.part", "sensitivity.json.7.part", "study.json.7.part"):
        (tmp_path / "out" / name).touch()
    sweep(study, tmp_path / "out", workers=1)
    assert not list((tmp_path / "out").glob("*.part"))
