"""Whole signals of a sweep: those of each run to the bit, on disk, over run, time and finger."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, metric, simulate, sweep
from grasp_cosim.sweeps import sweep as sweep_module
from grasp_cosim.sweeps.finished_runs import keep
from grasp_cosim.sweeps.signal_store import Store, dimension
from support.marks import needs_compiler
from support.native_systems import integrator

pytestmark = needs_compiler

POSITION = "plant.initial_object_position"
ROWS = {POSITION: [0.0, 0.01, 0.02]}
GAPS = ["plant.gap*", "plant.contact[1]", "controller.force[2]"]


@pytest.fixture
def native(grasp):
    return grasp.with_experiment(step=1e-3, stop=0.3).natively(True)


def same_as_runs(data, system, every=1):
    """True if the data of each run are those of a run of its own."""
    for run, position in enumerate(ROWS[POSITION]):
        own = simulate(system.with_values({POSITION: position}))
        for finger in (1, 2):
            found = data["plant.gap"].sel(run=run, finger=finger)
            assert found.values.tobytes() == own[f"plant.gap[{finger}]"][::every].tobytes()
        assert (data["plant.contact[1]"][run] == own["plant.contact[1]"][::every]).all()
        assert (data["controller.force[2]"][run] == own["controller.force[2]"][::every]).all()
    return data["time"].values.tolist() == own.time[::every].tolist()


@pytest.mark.parametrize("every", [1, 7])
def test_signals_are_those_of_each_run(native, every):
    data = sweep(native, ROWS, signals=GAPS, every=every).to_xarray()
    assert same_as_runs(data, native, every)
    assert data["plant.gap"].dims == ("run", "time", "finger")
    assert data["plant.gap"].attrs["units"] == "m"
    assert data["plant.gap"].attrs["long_name"]
    assert data[POSITION].dims == ("run",)
    assert set(data) - {"error"} >= {"plant.gap", "plant.contact[1]", "time_difference"}


@pytest.mark.slow
def test_they_are_the_same_from_any_place(native, tmp_path):
    found = sweep(native, ROWS, signals=GAPS).to_xarray()
    for name, more in (("python", {"native": False}), ("there", {"executor": ThreadPoolExecutor})):
        given = {key: value(2) if callable(value) else value for key, value in more.items()}
        table = sweep(native, ROWS, signals=GAPS, out=tmp_path / f"{name}.csv", **given)
        assert found.identical(table.to_xarray())


def test_zarr_reads_the_store(native, tmp_path, recwarn):
    xarray, _ = pytest.importorskip("xarray"), pytest.importorskip("zarr")
    sweep(native, ROWS, signals=GAPS, out=tmp_path / "t.csv")
    data = xarray.open_zarr(tmp_path / "t.zarr")
    assert not recwarn.list
    assert same_as_runs(data, native)
    assert (data["plant.gap"].dims, data["plant.gap"].attrs["units"]) == (
        ("run", "time", "finger"),
        "m",
    )
    assert data.coords[POSITION].values.tolist() == ROWS[POSITION]
    assert data["time"].attrs["units"] == "s"


def test_a_run_that_ends_early_or_fails_is_nan_from_there(native, tmp_path):
    rows = [{"experiment.stop": stop} for stop in (0.1, 0.2)]
    data = sweep(native, rows, signals="plant.gap*").to_xarray()["plant.gap"]
    assert np.isnan(data[0, 101:]).all()
    assert np.isfinite(data[0, :101]).all()
    assert np.isfinite(data[1]).all()
    assert data.shape == (2, 201, 2)
    system = integrator(tmp_path)
    failing = [{"a.gain": 1.0}, {"a.error_at": 0.055}]
    last = sweep(system, failing, signals=["a.x"], workers=1).to_xarray()["a.x"]
    assert last[0, -1] == pytest.approx(0.2, rel=1e-12)
    assert np.isnan(last[1]).all()


class StopError(Exception):
    pass


def test_a_sweep_that_goes_on_has_what_was_written(native, tmp_path, monkeypatch):
    def interrupted(file, outcome):
        keep(file, outcome)
        if outcome.index == 1:
            raise StopError

    out = tmp_path / "t.csv"
    monkeypatch.setattr(sweep_module, "keep", interrupted)
    with pytest.raises(StopError):
        sweep(native, ROWS, signals=GAPS, out=out, workers=1)
    monkeypatch.undo()
    written = tmp_path / "t.zarr/plant.gap"
    before = (written / "0.0.0").stat().st_mtime_ns
    (written / "1.0.0").unlink()  # which is done once more
    assert same_as_runs(sweep(native, ROWS, signals=GAPS, out=out).to_xarray(), native)
    assert (written / "0.0.0").stat().st_mtime_ns == before
    sweep(native, ROWS, signals=GAPS, out=out)
    assert (written / "0.0.0").stat().st_mtime_ns > before


def test_others_signals_are_no_part_of_what_is_kept(native, tmp_path, monkeypatch):
    def interrupted(file, outcome):
        keep(file, outcome)
        raise StopError

    monkeypatch.setattr(sweep_module, "keep", interrupted)
    with pytest.raises(StopError):
        sweep(native, ROWS, signals=GAPS, out=tmp_path / "t.csv")
    with pytest.raises(InputError, match="differ in the signals; remove it"):
        sweep(native, ROWS, signals=GAPS, every=2, out=tmp_path / "t.csv")


@pytest.mark.parametrize(
    ("signals", "rows", "said"),
    [
        (["plant.gpa*"], ROWS, r"record: 'plant.gpa\*' matches no signal"),
        (GAPS, {"experiment.step": [1e-3, 2e-3]}, "signals: the rows vary experiment.step; must"),
    ],
)
def test_what_cannot_be_kept_is_refused(native, signals, rows, said):
    with pytest.raises(InputError, match=said):
        sweep(native, rows, signals=signals)


def test_a_folder_of_something_else_is_left_alone(native, tmp_path):
    (tmp_path / "t.zarr").mkdir()
    (tmp_path / "t.zarr/zarr.json").write_text(json.dumps({"attributes": {}}))
    with pytest.raises(InputError, match=r"t\.zarr: is there, and has no signals of a sweep; rem"):
        sweep(native, ROWS, signals=GAPS, out=tmp_path / "t.csv")
    assert (tmp_path / "t.zarr/zarr.json").exists()


def test_signals_that_find_no_room_end_the_sweep(native, tmp_path, monkeypatch):
    def full(store, *_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Store, "write", full)
    with pytest.raises(SimulationError, match=r"t\.zarr: the signals of run \d were not written"):
        sweep(native, ROWS, signals=GAPS, out=tmp_path / "t.csv")


def test_a_system_without_a_metric_has_signals(tmp_path):
    table = sweep(integrator(tmp_path), [{"a.gain": 1.0}], signals="a.x", workers=1)
    assert table.to_xarray()["a.x"].dims == ("run", "time")


def test_entries_without_a_number_have_a_dimension_of_their_metric():
    ends = metric("reach", entries=("left", "right"))(lambda _: [])
    assert dimension(ends) == ("reach_entry", ("left", "right"))
    fingers = metric("touch", entries=("finger 1", "finger 2"))(lambda _: [])
    assert dimension(fingers) == ("finger", [1, 2])
