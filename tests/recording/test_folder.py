"""The folder of a run: never a mixture, whole lines, the same in the end; what is read back."""

import json
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, Realtime, SimulationError, simulate
from grasp_cosim.exchange.listener import Experiment
from grasp_cosim.recording.folder import FORMS, RunFolder
from grasp_cosim.recording.read_back import load_log, load_run
from grasp_cosim.recording.signals import read_signals
from recording.rows import EXPERIMENT, SIGNALS, full_disk, rows
from support.native_fmus import needs_gcc
from support.native_systems import integrator

CSV = '"time","a.x","a.on"\n0.0,1.5,1\n0.1,2.5e-300,0\n'
MADE = {
    "system": "made.toml", "scheme": "sequential", "step": 0.1, "stop": 0.1,
    "initialisation": {}, "components": {}, "connections": [], "events": [], "faults": [],
}  # fmt: skip
RUN = {
    **MADE, "wall_time": 0.5, "complete": True, "steps": 1, "rows": 2, "measured": {}, "log": [],
    "rejections": {},
}  # fmt: skip
JSON = {**RUN, "units": {"a.x": "m", "a.on": None}, "types": {"a.on": "bool"}}

DRAWN = ("grasp.png", "timing.png", "report.html", "signals.mf4")


@pytest.fixture
def run(grasp, tmp_path):
    with RunFolder(tmp_path, grasp, ["grasp-cosim", "run"]) as folder:
        yield folder


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("realtime", [False, Realtime()])
def test_it_ends_as_a_result_writes_it_and_is_read_back_as_it_was(grasp, tmp_path, form, realtime):
    """Paced or not, in the place of a run of the other form."""
    if form == "arrow":
        pytest.importorskip("pyarrow")
    system, on = grasp.with_experiment(step=1e-3, stop=0.1), tmp_path / "on"
    on.mkdir()
    for name in ("run.json", "signals.csv", "signals.arrow"):
        (on / name).touch()
    with RunFolder(on, system, ["run"], paced=bool(realtime), form=form) as folder:
        result = simulate(system, realtime=realtime, listeners=[folder], diverging="continue")
        folder.finish(result)
    (result.to_csv if form == "csv" else result.to_arrow)(tmp_path / f"signals.{form}")
    result.to_json(tmp_path / "run.json")
    assert sorted(p.name for p in on.iterdir()) == ["run.json", f"signals.{form}"]
    if form == "csv":
        assert (on / "signals.csv").read_bytes() == (tmp_path / "signals.csv").read_bytes()
    written, plain = (json.loads((p / "run.json").read_text()) for p in (on, tmp_path))
    assert {*written} - {*plain} == {"date", "versions", "fmus", "command"}
    assert {key: written[key] for key in plain} == plain
    for place in (on / f"signals.{form}", tmp_path):
        back = load_run(place)
        assert list(back) == list(result)
        assert back.time.tobytes() == result.time.tobytes()
        for name, column in result.items():
            assert (back[name].dtype, back[name].tobytes()) == (column.dtype, column.tobytes())
        assert (back.units, back.settings) == (dict(result.units), result.settings)
        assert back.settings["diverging"] == "continue"
        assert (back.metrics, back.timing) == (result.metrics, result.timing)


@pytest.mark.parametrize("form", FORMS)
def test_a_result_is_saved_as_a_run_is_recorded(grasp, tmp_path, form, monkeypatch):
    """In the place of an older one, also where some rows, or some signals, were recorded."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    system, saved = grasp.with_experiment(step=1e-3, stop=0.1), tmp_path / "saved"
    for chosen, every in ((system, 1), (system.with_record("plant.gap*"), 7)):
        with RunFolder(tmp_path / "on", chosen, form=form) as folder:
            result = simulate(chosen, listeners=[folder], every=every)
            folder.finish(result)
        result.save(str(saved), form)
        assert sorted(p.name for p in saved.iterdir()) == ["run.json", f"signals.{form}"]
        for name in {"run.json", f"signals.{form}"} - {"signals.arrow"}:  # its batches take a time
            assert (saved / name).read_bytes() == (tmp_path / "on" / name).read_bytes()
        back = load_run(saved)
        assert (back.metrics, back.units, back.log) == (result.metrics, result.units, result.log)
        assert all(np.array_equal(back[name], column) for name, column in result.items())
        back.save(tmp_path / "again", form)
        texts = ((folder / "run.json").read_text() for folder in (saved, tmp_path / "again"))
        assert len({json.dumps(json.loads(text), sort_keys=True) for text in texts}) == 1


def test_what_waits_is_written_in_spare_time(grasp, tmp_path):
    table = rows(100)
    with RunFolder(tmp_path, grasp, paced=True) as folder:
        folder.begin(EXPERIMENT, SIGNALS)
        folder.block(np.arange(1), table[:1])
        folder.block(np.arange(1, 100), table[1:])
        lines = (tmp_path / "signals.csv").read_text().splitlines()
        assert len(lines) == 2
        while folder.spare(1e5):
            pass
        lines = (tmp_path / "signals.csv").read_text().splitlines()
        assert len(lines) == 101
        folder.end(complete=False)


@pytest.mark.parametrize("torn", [0, 1, 40])
def test_it_can_be_read_while_the_run_goes_on(run, tmp_path, torn):
    """Also where a kill came while a line was written."""
    table = rows(50)
    run.begin(Experiment.of(MADE), SIGNALS)
    run.block(np.arange(50), table)
    data = (tmp_path / "signals.csv").read_bytes()
    (tmp_path / "signals.csv").write_bytes(data[: len(data) - torn])
    read = load_run(tmp_path)
    whole = 50 if not torn else 49
    assert (read.complete, read.wall_time, len(read.time)) == (False, None, whole)
    assert read["a.x[1]"].tolist() == table[:whole, 0].tolist()
    assert read["a.on"].dtype == np.bool_
    assert read.metrics["real_time_factor"] is None
    assert read.origin["command"] == ["grasp-cosim", "run"]
    run.end(complete=False)


@pytest.mark.parametrize("form", FORMS)
def test_a_crash_at_once_loses_no_more_than_the_last_batch(grasp, tmp_path, form):
    """The first row is there as soon as it came: the file that a crash would leave is read."""
    if form == "arrow":
        pytest.importorskip("pyarrow")
    with RunFolder(tmp_path, grasp, form=form) as folder:
        folder.begin(Experiment.of(MADE), SIGNALS)
        folder.block(np.arange(1), rows(1))
        read = load_run(tmp_path)
        assert (read.complete, read.wall_time, read.time.tolist()) == (False, None, [0.0])
        folder.end(complete=False)


def test_without_a_row_the_older_run_stays(run, tmp_path):
    for name in ("run.json", "signals.csv", *DRAWN):
        (tmp_path / name).write_text("older")
    run.begin(EXPERIMENT, SIGNALS)
    run.end(complete=False)
    assert {p.read_text() for p in tmp_path.iterdir()} == {"older"}


class Killed(BaseException):
    """Stands for a kill between two changes of the folder."""


@pytest.mark.parametrize("moment", range(12))
def test_a_kill_at_no_moment_leaves_a_mixture(run, tmp_path, monkeypatch, moment):
    """The older run with what there is of it, ours, or no run at all: nothing without run.json."""
    for name in ("run.json", "signals.csv", *DRAWN):
        (tmp_path / name).write_text("older")
    left = moment

    def counted(change):
        real = getattr(Path, change)

        def changed(self, *arguments, **options):
            nonlocal left
            if left == 0:
                raise Killed
            left -= 1
            return real(self, *arguments, **options)

        monkeypatch.setattr(Path, change, changed)

    for change in ("unlink", "replace"):
        counted(change)
    run.begin(EXPERIMENT, SIGNALS)
    with suppress(Killed):
        run.block(np.arange(1), rows(1))
    monkeypatch.undo()
    run.end(complete=False)
    there = {p.name for p in tmp_path.iterdir() if not p.name.endswith(".part")}
    if "run.json" in there:
        older = (tmp_path / "run.json").read_text() == "older"
        assert ((tmp_path / "signals.csv").read_text() == "older") == older
        assert older or not there & {*DRAWN}
    else:
        assert not there & {*DRAWN}


def test_two_runs_do_not_share_a_folder_nor_is_one_in_a_file(run, grasp, tmp_path):
    run.begin(EXPERIMENT, SIGNALS)
    run.block(np.arange(2), rows(2))
    with RunFolder(tmp_path, grasp) as second:
        second.begin(EXPERIMENT, SIGNALS)
        with pytest.raises(InputError, match="another process records a run in it; must end"):
            second.block(np.arange(2), rows(2))
        second.end(complete=False)
    run.end(complete=True)
    assert len((tmp_path / "signals.csv").read_text().splitlines()) == 3
    below = RunFolder(tmp_path / "run.json" / "out", grasp)
    below.begin(EXPERIMENT, SIGNALS)
    with pytest.raises(InputError, match="out: cannot be written: Not a directory"):
        below.block(np.arange(2), rows(2))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("every", [1, 3])
def test_of_a_run_that_ended_a_file_that_was_cut_is_damaged(grasp, tmp_path, form, every):
    if form == "arrow":
        pytest.importorskip("pyarrow")
    system = grasp.with_experiment(1e-3, 0.02)
    with RunFolder(tmp_path, system, form=form) as folder:
        folder.finish(simulate(system, listeners=[folder], every=every))
    path = tmp_path / f"signals.{form}"
    whole = load_run(tmp_path)
    assert whole.complete
    data = path.read_bytes()
    if form == "csv":
        lines = data.splitlines(keepends=True)
        without_one = b"".join([*lines[:4], *lines[5:]])
        cuts = [data[:-1], data[:-30], b"".join(lines[:-1]), without_one, data + lines[-1]]
    else:
        cuts = [data[:20], data[: len(data) // 2]]
    for cut in cuts:
        path.write_bytes(cut)
        with pytest.raises(InputError, match=r"is damaged[:,] ") as refused:
            load_run(tmp_path)
        assert "\n" not in str(refused.value)
    written = json.loads((tmp_path / "run.json").read_text())
    path.write_bytes(cuts[1])
    (tmp_path / "run.json").write_text(json.dumps({**written, "complete": False}))
    with pytest.raises(InputError, match="is damaged"):  # it was interrupted, and cut later
        load_run(tmp_path)


@needs_gcc
@pytest.mark.parametrize("values", [{"a.error_at": 0.045}, {"a.terminate_at": 0.045}])
@pytest.mark.parametrize("every", [1, 7])
def test_a_run_that_ended_early_is_whole(tmp_path, values, every):
    system = integrator(tmp_path).with_values(values)
    with RunFolder(tmp_path / "out", system) as folder:
        try:
            result = simulate(system, listeners=[folder], every=every)
        except SimulationError as error:
            result = error.result
        folder.finish(result)
    assert load_run(tmp_path / "out").time.tolist() == result.time.tolist()


@needs_gcc
def test_rows_that_find_no_room_at_the_end_leave_what_was_whole(tmp_path):
    """The run.json of the end would have rows that are not there, and the folder be damaged."""
    pytest.importorskip("pyarrow")
    system = integrator(tmp_path)
    with RunFolder(tmp_path / "out", system, form="arrow") as folder:

        class Full:
            """A listener behind the folder, from whose beginning on nothing more is written."""

            def begin(self, *_):
                pass

            def block(self, *_):
                pass

            def end(self, complete):
                size = (tmp_path / "out/signals.arrow").stat().st_size
                with full_disk(size), pytest.raises(SimulationError, match="arrow: cannot be wri"):
                    folder.end(complete)

        class Begun:
            begin, block = folder.begin, folder.block

            def end(self, complete):
                pass

        result = simulate(system, step=1e-3, listeners=[Begun(), Full()])
        folder.finish(result)
    back = load_run(tmp_path / "out")
    assert (back.complete, back.time[0]) == (False, 0.0)
    assert len(back.time) < len(result.time)


@needs_gcc
def test_a_run_json_that_finds_no_room_is_said_by_the_name_that_was_given(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    system = integrator(tmp_path)
    refused = pytest.raises(SimulationError, match=r"^out/run\.json: cannot be written: File too")
    with RunFolder(Path("out"), system) as folder:
        result = simulate(system, listeners=[folder])
        with full_disk(10), refused:
            folder.finish(result)
    assert not load_run("out").complete


# ----------------------------------------------------------------- read back


def written(path, csv=CSV, **more):
    (path / "signals.csv").write_bytes(csv.encode() if isinstance(csv, str) else csv)
    (path / "run.json").write_text(json.dumps({**JSON, **more}))
    return path


def test_columns_have_their_types_and_real_is_the_default(tmp_path):
    """Values that are not finite are kept: a run that failed ends with them."""
    run = load_run(written(tmp_path, CSV + "0.2,nan,1\n0.3,-inf,1\n", steps=3, rows=4))
    np.testing.assert_array_equal(run.signals["a.x"], [1.5, 2.5e-300, np.nan, -np.inf])
    assert run.signals["a.on"].dtype == np.bool_
    assert run.signals["a.on"].tolist() == [True, False, True, True]
    assert run.descriptions == {}
    run = load_run(written(tmp_path, '"time"\n0.0\n', units={}, steps=0, rows=1))
    assert (run.time.tolist(), run.signals) == ([0.0], {})
    (tmp_path / "signals.csv").unlink()
    with pytest.raises(InputError, match=r"run\.json: this run recorded no signal; must"):
        load_run(tmp_path)


@pytest.mark.parametrize(
    ("csv", "reason"),
    [
        ("", "is empty; must have names in its first line"),
        ('"t","a.x"\n0.0,1.5\n', "the first column is 't'; must be \"time\""),
        ('"time","a.x","a.on"\n', "it has no whole row; must have one"),
        (CSV[:-1], "has 1 row, the last of step 0; must have 2, the last of step 1, as run.json"),
        (CSV[:-10], "has 1 row, the last of step 0; must have 2, the last of step 1, as run.json"),
        (CSV + "0.2,1,1\n", "has 3 rows, the last of step 2; must have 2, the last of step 1"),
        (CSV.replace("0.1,", "0.2,"), "has 2 rows, the last of step 2; must have 2, the last of"),
        (CSV + "0.2,1\n", "line 4 has 2 cells; must have 3, as line 1"),
        (CSV + "0.2,1,x\n", "line 4, column 3, a.on = 'x': must be a number"),
        (CSV + "0.1,1,1\n", "the time must grow from row to row"),
        (CSV + "1e300,1,1\n", "the time must grow from row to row, to at most 1e+09 s"),
        (CSV + "nan,1,1\n", "the time must grow from row to row"),
        (CSV.replace("a.on", "a.x"), "two columns have the same name"),
        ('"time","a.x\n0.0,1\n', "unexpected end of data; must be a CSV file"),
        (CSV.replace("x", "\xe9").encode("latin-1"), "'utf-8' codec can't decode byte"),
    ],
)
def test_signals_that_are_damaged_are_refused_in_one_line(tmp_path, csv, reason):
    with pytest.raises(InputError) as caught:
        load_run(written(tmp_path, csv))
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'signals.csv'}: ")
    assert reason in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"{", "is damaged, not JSON in UTF-8: "),
        (b"\xff", "is damaged, not JSON in UTF-8: "),
        (b"[]", "is list; must be a JSON object"),
        (b"{}", "no entry 'system'; must have one, as `grasp-cosim run --out` writes it"),
        ({"units": 1}, "units = 1; must be a JSON object"),
        ({"step": True}, "step = True; must be a number"),
        ({"wall_time": "3"}, "wall_time = '3'; must be a number or null"),
        ({"complete": 1}, "complete = 1; must be true or false"),
        ({"log": {}}, "log = {}; must be a list"),
        ({"rejections": {"a": {"count": 1}}}, "rejections: a: no entry 'first'; must have"),
        ({"types": {"a.on": []}}, "types: a.on = []; must be a string"),
        ({"types": {"a.on": "bit"}}, "type of a.on = 'bit': must be one of float64,"),
        ({"types": {"a.x": "int64"}}, "a.x = int64: must be a type of its values, like 1.5"),
        ({"units": {"a.x": "m"}}, "those of the recorded columns: a.x, a.on"),
        ({"units": {"a.on": None, "a.x": "m"}}, "those of the recorded columns: a.x, a.on"),
        ({"units": {"a.x": "m", "b.y": None}}, "units are those of a.x, b.y; must be those of"),
        ({"units": {"a.on": None, "a.a": "m"}}, "units are those of a.on, a.a; must be those of"),
        ({"to_si": {"a.x": 1.0}}, "to_si: a.x = 1.0; must be a JSON object"),
    ],
)
def test_a_run_json_that_is_damaged_is_refused_in_one_line(tmp_path, content, reason):
    written(tmp_path, **(content if isinstance(content, dict) else {}))
    if isinstance(content, bytes):
        (tmp_path / "run.json").write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_run(tmp_path)
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'run.json'}: ")
    assert reason in message
    assert "\n" not in message


def test_the_time_may_go_on_for_as_long_as_a_run(tmp_path):
    csv = CSV.replace("0.1,", "1e9,")
    assert load_log(written(tmp_path, csv) / "signals.csv").time.tolist() == [0.0, 1e9]
    time, _ = read_signals(tmp_path / "signals.csv", ())
    assert time.tolist() == [0.0, 1e9]


@pytest.mark.parametrize("column", [[3.0, 1.5], [3.0, -1.5], [-2.0, 2.25]])
def test_the_value_that_has_no_type_is_named(tmp_path, column):
    rows = "".join(f"{k / 10},{value},1\n" for k, value in enumerate(column))
    written(tmp_path, f'"time","a.x","a.on"\n{rows}', types={"a.x": "int64"})
    with pytest.raises(InputError, match=f"must be a type of its values, like {column[1]}$"):
        load_run(tmp_path)


@pytest.mark.parametrize("name", ["run.json", "signals.csv"])
def test_a_file_that_is_missing_is_named(tmp_path, name):
    (written(tmp_path) / name).unlink()
    with pytest.raises(InputError, match=f"{name}: No such file or directory; must be a folder"):
        load_run(tmp_path)


def test_metrics_and_logs_get_si_as_run_json_says_and_signals_stay_as_recorded(tmp_path):
    entry = {"a.x": {"factor": 0.5, "offset": 1.0}}
    run = load_run(written(tmp_path, to_si=entry, units={"a.x": "mm", "a.on": None}))
    assert run.by_role["a.x"][0] == 0.5 * 1.5 + 1.0
    assert (run["a.x"][0], run.units["a.x"]) == (1.5, "mm")
    said, other = [], tmp_path / "measured.csv"
    assert load_log(tmp_path / "signals.csv", said.append)["a.x"][0] == 0.5 * 1.5 + 1.0
    assert not said
    other.write_text(CSV, "utf-8")
    assert load_log(other, said.append)["a.x"][0] == 1.5
    assert said == [
        f"{other}: there is no run.json next to it; its values are taken to be in SI units"
    ]
