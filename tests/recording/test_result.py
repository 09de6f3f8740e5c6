"""What a run leaves behind, and the files that it writes."""

import errno
import json
from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, simulate
from grasp_cosim.base.files import in_one_piece
from grasp_cosim.recording.load import load_run
from grasp_cosim.recording.result import Rejection
from grasp_cosim.system.settings import run_settings
from recording.rows import full_disk


@pytest.fixture(scope="module")
def result(grasp):
    """A short run."""
    return simulate(grasp, stop=0.1)


def decimated(result, every):
    """Every n-th communication point, and the last."""
    kept = sorted({*range(0, len(result.time), every), len(result.time) - 1})
    return replace(
        result,
        time=result.time[kept],
        signals={name: column[kept] for name, column in result.items()},
    )


def test_csv_is_each_value_as_python_prints_it(result, tmp_path):
    result.to_csv(tmp_path / "s.csv")
    columns = [result.time, *result.signals.values()]
    expected = [",".join(f'"{name}"' for name in ("time", *result))]
    for row in zip(*(column.tolist() for column in columns), strict=True):
        expected.append(",".join(repr(v) if isinstance(v, float) else str(int(v)) for v in row))
    assert (tmp_path / "s.csv").read_text() == "\n".join(expected) + "\n"


def test_a_decimated_result_keeps_its_times(result, tmp_path):
    few = decimated(result, 300)
    assert few.metrics["steps"] == result.metrics["steps"] == 1000
    few.to_csv(tmp_path / "signals.csv")
    few.to_json(tmp_path / "run.json")
    run = load_run(tmp_path)
    assert run.time.tolist() == [0.0, 0.03, 0.06, 0.09, 0.1]
    assert run.signals["plant.gap[1]"].tolist() == few["plant.gap[1]"].tolist()


def test_mdf_has_the_columns_and_whether_the_run_was_complete(result, tmp_path):
    asammdf = pytest.importorskip("asammdf")
    described = replace(result, complete=False, descriptions={"plant.gap[1]": "to the object"})
    described.to_mdf(tmp_path / "s.mf4")
    assert [path.name for path in tmp_path.iterdir()] == ["s.mf4"]
    with asammdf.MDF(tmp_path / "s.mf4") as file:
        assert [c.name for c in file.groups[0].channels] == ["time", *result]
        for name, column in result.items():
            channel = file.get(name)
            assert channel.samples.tolist() == column.tolist()
            assert channel.timestamps.tolist() == result.time.tolist()
            assert channel.unit == (result.units[name] or "")
        assert file.get("plant.gap[1]").comment == "to the object"
        assert '<e name="complete">false</e>' in file.header.comment


def test_json_has_the_metrics_and_what_led_to_them(grasp, result, tmp_path):
    told = replace(
        result,
        descriptions={"plant.gap[1]": "to the object"},
        log=("the plant rejected a step",),
        rejections={"plant": Rejection(3, 0.25)},
    )
    told.to_json(tmp_path / "run.json")
    found = json.loads((tmp_path / "run.json").read_text())
    assert found == {
        **json.loads(json.dumps(dict(result.metrics))),
        **run_settings(grasp.with_experiment(stop=0.1)),
        "units": dict(result.units),
        "to_si": {},
        "types": {
            name: {"f": "float64", "b": "bool"}[column.dtype.kind]
            for name, column in result.items()
        },
        "descriptions": {"plant.gap[1]": "to the object"},
        "metric_units": result.metric_units,
        "missing_metrics": [],
        "log": ["the plant rejected a step"],
        "rejections": {"plant": {"count": 3, "first": 0.25}},
    }


def test_a_full_disk_leaves_the_file_that_was_there(result, tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("before")
    with full_disk(10_000), pytest.raises(SimulationError, match="cannot be written: File too"):
        result.to_csv(path)
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("s.csv", "before")]


def test_a_result_of_integers_is_written_as_integers(result, tmp_path):
    counts = np.arange(len(result.time), dtype=np.int64)
    replace(result, signals={"a.n": counts}, units={"a.n": None}).to_csv(tmp_path / "s.csv")
    assert (tmp_path / "s.csv").read_text().splitlines()[-1] == "0.1,1000"


def test_a_result_without_signals_has_nothing_to_draw(result, tmp_path):
    bare = replace(result, signals={}, units={})
    with pytest.raises(InputError, match=r"s\.png: nothing to draw; must be a result with "):
        bare.plot(tmp_path / "s.png")


def test_a_file_that_cannot_be_written_is_named_and_not_left_behind(tmp_path):
    """A write to a full disk fails without saying which file it was."""

    def fill():
        with in_one_piece(tmp_path / "a.json") as part:
            part.write_text("half")
            raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError, match="No space left on device") as caught:
        fill()
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(tmp_path / "a.json"))
    assert list(tmp_path.iterdir()) == []
