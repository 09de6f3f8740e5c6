"""Whole sweeps: the same table from any processes, failures as rows, going on after an end."""

import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import ProcessPoolExecutor
from io import FileIO
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest
from grasp_cosim import InputError, System, inspect_fmu, metric, simulate, sweep, write_ssp
from grasp_cosim.metrics.metric import load_metrics
from grasp_cosim.sweeps.executors import cluster
from grasp_cosim.sweeps.finished_runs import identity_of, keep, opened, write_line
from grasp_cosim.sweeps.rows import grid
from grasp_cosim.sweeps.run import Task, packed, run_packed, run_row
from grasp_cosim.sweeps.table import Outcome
from recording.rows import full_disk
from support.native_fmus import needs_gcc, talker
from support.native_systems import integrator, write_integrator
from support.processes import ends

pytestmark = needs_gcc

LAST = '''
from grasp_cosim import metric


@metric("last", unit="s", needs=["a.y"])
def last(run):
    """The last output."""
    return float(run["a.y"][-1])
'''

FAILING = grid({"a.gain": [1.0, 2.0, 3.0], "a.error_at": [1e9, 0.055]})


@pytest.fixture
def system(tmp_path):
    return integrator(tmp_path)


@pytest.fixture
def mine(system, tmp_path):
    return load_metrics(tmp_path / "mine.py")


def test_a_task_that_travels_is_the_same(system, mine):
    task = Task(system, mine)
    here = run_row(task, 3, {"a.gain": 2.0})
    assert here.metrics == {"end": pytest.approx(0.4), "half[1]": True, "half[2]": None}
    for with_fmus in (False, True):
        shared = packed(task, with_fmus)
        assert run_packed(shared, (3, {"a.gain": 2.0})) == here
        assert bool(shared.fmus) == with_fmus


@pytest.mark.slow
def test_texts_stand_for_paths(system, mine, tmp_path):
    path, rows = str(tmp_path / "system.toml"), [{"a.gain": 2.0}]
    assert simulate(path)["a.x"].tolist() == simulate(system)["a.x"].tolist()
    assert sweep(path, rows, metrics=mine, workers=1) == sweep(system, rows, metrics=mine)
    fmu = system.components[0].fmu
    assert inspect_fmu(str(fmu)) == inspect_fmu(fmu)
    write_ssp(path, str(tmp_path / "system.ssp"))
    assert System.load(str(tmp_path / "system.ssp")).components[0].name == "a"
    for call in (
        simulate,
        lambda given: sweep(given, rows),
        lambda given: write_ssp(given, "a.ssp"),
    ):
        with pytest.raises(InputError, match=r": int '3': must be a System, as .*, or the path of"):
            call(3)


@pytest.mark.slow
def test_the_bytes_are_those_of_any_processes(system, mine, tmp_path):
    one, two = (
        sweep(system, FAILING, metrics=mine, workers=n, out=tmp_path / f"{n}.csv") for n in (1, 2)
    )
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        sweep(system, FAILING, metrics=mine, executor=pool, out=tmp_path / "pool.csv")
    texts = {(tmp_path / f"{name}.csv").read_text() for name in (1, 2, "pool")}
    assert len(texts) == 1
    assert not list(tmp_path.glob("*.rows"))
    assert one == two
    assert one.varied == ("a.gain", "a.error_at")
    assert one["end"][::2] == pytest.approx([0.2, 0.4, 0.6], rel=1e-12)
    assert set(one.errors) == {1, 3, 5}
    assert all(e.startswith("a: ") and "\n" not in e for e in one.errors.values())
    assert one.units["end"] == "m"


@pytest.mark.slow
@pytest.mark.parametrize("fails", [False, True])
def test_a_crash_as_an_fmu_is_freed_takes_no_result(tmp_path, fails):
    failure = ['-DAT_STEP=if (time > 0.45) return fail(m, 3, "stuck")'] if fails else []
    talker(tmp_path, "-DAT_FREE=abort()", *failure)
    file = tmp_path / "talk.toml"
    file.write_text(
        '[experiment]\nstep = 0.1\nstop = 1.0\n[components.a]\nfmu = "talker.fmu"\n', "utf-8"
    )
    (tmp_path / "last.py").write_text(LAST, "utf-8")
    rows = [{"experiment.step": step} for step in (0.1, 0.2, 0.5)]
    table = sweep(System.load(file), rows, metrics=load_metrics(tmp_path / "last.py"), workers=1)
    if fails:
        assert [error.partition(" at t")[0] for error in table.errors.values()] == [
            "a: talker.fmu returned error"
        ] * 3
    else:
        assert (table["last"].tolist(), table.errors) == ([1.0] * 3, {})


@pytest.mark.slow
def test_a_crash_takes_its_own_run_only(system, mine):
    rows = [{"a.crash_at": at} for at in (1e9, 0.055, 1e8, 0.035, 1e7)]
    for workers in (1, 2):
        table = sweep(system, rows, metrics=mine, workers=workers)
        assert set(table.errors) == {1, 3}
        assert "the process of the run ended with signal" in table.errors[1]


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_rows_come_through_a_pipe_too(system, mine, tmp_path):
    pipe = tmp_path / "rows"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=("a.gain\n1.0\n2.0\n",))
    writer.start()
    table = sweep(system, pipe, metrics=mine, workers=1)
    writer.join()
    assert table["end"].tolist() == pytest.approx([0.2, 0.4], rel=1e-12)


def test_what_is_refused_before_any_run(system, mine, tmp_path):
    for rows, more, said in (
        ([{"a.gian": 1.0}], {}, "did you mean gain"),
        ([{"a.gain": "x"}], {}, "gain"),
        ([{"a.gain": 1.0}], {"workers": 0}, "workers = 0"),
        ([{"a.gain": 1.0}], {"out": tmp_path / "t.txt"}, "must end in .csv or .parquet"),
    ):
        with pytest.raises(InputError, match=said):
            sweep(system, rows, metrics=mine, **more)
    with pytest.raises(InputError, match="has no metric"):
        sweep(system, [{"a.gain": 1.0}])


def test_a_filtered_frame_gets_the_result_of_each_row(system, mine):
    frame = pd.DataFrame({"a.gain": [1.0, 2.0, 3.0, 4.0]}).query("`a.gain` % 2 == 0")
    joined = frame.join(sweep(system, frame, metrics=mine, workers=1).to_pandas()[["end"]])
    assert joined["end"].tolist() == pytest.approx([0.4, 0.8], rel=1e-12)


def test_a_row_that_does_not_fit_is_an_error_of_its_own(system, mine):
    table = sweep(system, [{"a.gain": 1.0}, {"a.gain": "x"}], metrics=mine, workers=1)
    assert list(table.errors) == [1]
    assert "gain" in table.errors[1]


# ------------------------------------------------------------------------ going on

RUNS = 60
ARGUMENTS = ["sweep", "system.toml", "--vary", f"a.gain=1:2:{RUNS}", "--metrics", "mine.py"]
PROGRAM = """
import os, signal, sys
from grasp_cosim.cli import entry
from grasp_cosim.sweeps import sweep

keep, kept = sweep.keep, []

def keep_and_act(file, outcome):
    keep(file, outcome)
    kept.append(outcome)
    if len(kept) == COUNT:
        ACT

sweep.keep = keep_and_act
entry()
"""
KILL = (
    "print(open(f'/proc/self/task/{os.getpid()}/children').read(), flush=True); "
    "os.kill(os.getpid(), signal.SIGKILL)"
)


def sweeping(folder, count=0, act="pass"):
    """Exit code and output of a command that acts right after it has kept so many runs."""
    program = PROGRAM.replace("COUNT", str(count)).replace("ACT", act)
    done = subprocess.run(
        [sys.executable, "-c", program, *ARGUMENTS], cwd=folder, text=True,
        start_new_session=True, capture_output=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


def kept(folder):
    return (folder / "sweep.csv.rows").read_bytes().splitlines()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="this system has no /proc")
def test_killed_it_goes_on_and_comes_to_the_same_table(tmp_path):
    write_integrator(tmp_path)
    code, started, _ = sweeping(tmp_path, 7, KILL)
    assert code == -signal.SIGKILL
    assert all(ends(int(pid)) for pid in started.split())
    first = kept(tmp_path)
    assert len(first) == 8  # one says what they are of
    with (tmp_path / "sweep.csv.rows").open("ab") as file:
        file.write(b'{"index": 3, "metr')  # torn
    assert sweeping(tmp_path, 5, KILL)[0] == -signal.SIGKILL
    assert kept(tmp_path)[:8] == first
    assert len(kept(tmp_path)) == 13
    code, out, err = sweeping(tmp_path)
    assert (code, out.splitlines()[0]) == (0, f"{RUNS} runs, 0 failed"), err
    assert not (tmp_path / "sweep.csv.rows").exists()
    resumed = (tmp_path / "sweep.csv").read_bytes()
    assert sweeping(tmp_path)[0] == 0
    assert (tmp_path / "sweep.csv").read_bytes() == resumed


@pytest.mark.slow
@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("whom", ["0", "os.getpid()"])
def test_ctrl_c_keeps_what_is_done(tmp_path, whom):
    """It is for all processes, as from a terminal, or for the command alone."""
    write_integrator(tmp_path)
    code, out, err = sweeping(tmp_path, 5, f"os.kill({whom}, signal.SIGINT)")
    assert (code, out) == (130, "")
    said = "finished runs are kept next to sweep.csv; the same command continues"
    line = f"grasp-cosim: interrupted; {said}"
    assert len(kept(tmp_path)) >= 6
    assert any(one.endswith(line) for one in err.splitlines())  # behind what an FMU had begun


@pytest.mark.slow
def test_kept_runs_are_bound_to_what_they_are_of(system, mine, tmp_path):
    out = tmp_path / "t.csv"
    rows = [{"a.gain": 1.0}, {"a.gain": 2.0}]
    sweep(system, rows, metrics=mine, out=out, workers=1)
    whole = out.read_bytes()
    (tmp_path / "t.csv.rows").write_bytes(b'{"runs of": "others"}\n{"index": 0}\n')
    with pytest.raises(
        InputError, match="has runs that differ in all that is known of them; remove it"
    ):
        sweep(system, rows, metrics=mine, out=out, workers=1)
    (tmp_path / "t.csv.rows").write_bytes(b'{"runs of": "others"}\n')  # of which there are none
    sweep(system, rows, metrics=mine, out=out, workers=1)
    assert out.read_bytes() == whole


SHARE = 0.5


def half(value):
    return SHARE * value


def share(run):
    return half(run["a.x"][-1])


def quarter(run):
    return 0.5 * half(run["a.x"][-1])


@pytest.mark.parametrize(
    ("change", "differs"),
    [
        ({"function": quarter}, "metric 'share', its code"),
        ({"SHARE": 0.25}, "metric 'share', its half"),
        ({"rows": [{"a.gain": 1.0}]}, "the rows"),
        ({"stop": 0.2}, "the system's stop"),
        ({"fmu": b"of another maker"}, "the FMU of a"),
    ],
)
def test_what_decides_a_row_is_what_kept_runs_are_of(
    system, tmp_path, monkeypatch, change, differs
):
    def named(system, rows, function, **_):
        return identity_of(Task(system), rows, [metric("share")(function)])

    given = {"system": system, "rows": [{"a.gain": 2.0}], "function": share}
    with opened(tmp_path / "t.csv", named(**given), {}) as file:
        keep(file, Outcome(0, {"share": 0.2}))
        before = Path(file.name).read_bytes()
    (tmp_path / "t.csv.rows").write_bytes(before)  # as of runs that were interrupted
    done = {}
    with opened(tmp_path / "t.csv", named(**given), done):
        assert set(done) == {0}
    (tmp_path / "t.csv.rows").write_bytes(before)
    monkeypatch.setitem(globals(), "SHARE", change.get("SHARE", SHARE))
    if "stop" in change:
        change = {"system": system.with_experiment(stop=change["stop"])}
    elif "fmu" in change:
        (component,) = system.components
        component.fmu.write_bytes(change["fmu"])
    with (
        pytest.raises(
            InputError, match=rf"t\.csv\.rows: has runs that differ in {differs}; remove"
        ),
        opened(tmp_path / "t.csv", named(**given | change), {}),
    ):
        pass


def test_runs_that_were_kept_have_their_metrics_in_the_order_of_the_others(tmp_path):
    """It is that of the columns of the table."""
    with opened(tmp_path / "t.csv", {}, {}) as file:
        keep(file, Outcome(0, {"width": 1.0, "time": 2.0}))
        before = Path(file.name).read_bytes()
    (tmp_path / "t.csv.rows").write_bytes(before)
    done = {}
    with opened(tmp_path / "t.csv", {}, done):
        assert list(done[0].metrics) == ["width", "time"]


def test_two_at_a_time_are_refused(system, mine, tmp_path):
    with opened(tmp_path / "t.csv", {}, {}), pytest.raises(InputError, match="another process"):
        sweep(system, [{"a.gain": 1.0}], metrics=mine, out=tmp_path / "t.csv", workers=1)


# ------------------------------------------------------------------------ on a cluster


@pytest.mark.slow
def test_a_dask_cluster_gives_the_same_bits(system, mine, tmp_path):
    distributed = pytest.importorskip("distributed", reason="dask is not installed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=2, dashboard_address="127.0.0.1:0", host="127.0.0.1"
    ) as local:
        with cluster(local.scheduler_address) as executor:
            there = sweep(system, FAILING, metrics=mine, executor=executor, out=tmp_path / "t.csv")
        command = [*ARGUMENTS, "--scheduler", local.scheduler_address, "--out", "c.parquet"]
        done = subprocess.run(
            [sys.executable, "-m", "grasp_cosim", *command],
            cwd=tmp_path, capture_output=True, text=True, check=False, env={**os.environ},
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "c.parquet").exists()
    assert there == sweep(system, FAILING, metrics=mine, workers=2)


def test_a_scheduler_that_is_none(monkeypatch):
    def client(*_, **__):
        raise TimeoutError

    for module, said in (
        (None, r"pip install 'distributed>="),
        (SimpleNamespace(Client=client), "--scheduler tcp://x: TimeoutError; must be one that"),
    ):
        monkeypatch.setitem(sys.modules, "distributed", module)
        with pytest.raises(InputError, match=said), cluster("tcp://x"):
            pass


@metric("one", unit="1")
def one(run):
    """A number."""
    return 1.0


def test_a_file_of_runs_that_finds_no_room_is_said(tmp_path):
    system = integrator(tmp_path)
    with (
        full_disk(10),
        pytest.raises(InputError, match=r"t\.csv\.rows: cannot be written: (File too|No space)"),
    ):
        sweep(system, [{"a.gain": 1.0}], metrics=[one], out=tmp_path / "t.csv", workers=1)


@pytest.mark.parametrize("line", [b"\0\0\0", b"null", b"{}", b'{"index": "0", "metrics": {}}'])
def test_a_damaged_line_of_what_is_kept_is_said(tmp_path, line):
    path = tmp_path / "t.csv.rows"
    path.write_bytes(b'{"runs of": {"x": "1"}}\n' + line + b'\n{"index": 1, "metrics": {}}\n')
    with (
        pytest.raises(InputError, match=r"t\.csv\.rows: line 2 is damaged; remove the file, or"),
        opened(tmp_path / "t.csv", {"x": "1"}, {}),
    ):
        pass


def test_there_is_never_half_a_line_of_what_is_kept(tmp_path):
    path = tmp_path / "rows"
    with FileIO(path, "a") as file:
        write_line(file, b"whole\n")
        with full_disk(10), pytest.raises(OSError, match="No space"):
            write_line(file, b"half of it\n")
        write_line(file, b"next\n")
    assert path.read_bytes() == b"whole\nnext\n"
