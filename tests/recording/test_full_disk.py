"""A full disk: whatever writes a result names the file that was asked for, and leaves no other."""

import numpy as np
import pytest
from grasp_cosim import Result, SimulationError
from recording.rows import full_disk

SETTINGS = {
    "system": "bare", "scheme": "sequential", "step": 0.001, "stop": 1.0, "initialisation": {},
    "components": {}, "connections": [], "events": [], "faults": [],
}  # fmt: skip


@pytest.fixture
def result():
    time = np.arange(1001, dtype=np.float64) * 0.001
    noise = np.random.default_rng(1).standard_normal(1001)
    return Result(SETTINGS, time, {"a.x": noise}, {"a.x": "m"}, 1.0, True)


@pytest.mark.parametrize("kind", ["csv", "mdf"])
def test_a_recording(tmp_path, result, kind):
    if kind == "mdf":
        pytest.importorskip("asammdf")
    path = tmp_path / f"signals.{kind}"
    write = {"csv": result.to_csv, "mdf": result.to_mdf}[kind]
    with full_disk(4000), pytest.raises(SimulationError) as caught:
        write(path)
    assert str(caught.value) == f"{path}: cannot be written: File too large"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["json", "plot"])
def test_what_is_beside_it(tmp_path, result, kind):
    if kind == "plot":
        pytest.importorskip("matplotlib")
        result.plot(tmp_path / "before.png")  # matplotlib may write a cache of its own
        (tmp_path / "before.png").unlink()
    path = tmp_path / {"json": "run.json", "plot": "run.png"}[kind]
    writers = {"json": result.to_json, "plot": result.plot}
    with full_disk(100), pytest.raises(OSError, match="too large") as caught:
        writers[kind](path)
    assert caught.value.filename == str(path)
    assert list(tmp_path.iterdir()) == []
