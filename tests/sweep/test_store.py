"""The folder of a study: bound to it, and whole after whatever happened."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim import InputError, SimulationError, System
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.distributions import Uniform
from grasp_cosim.sweep.run import Outcome
from grasp_cosim.sweep.store import Store
from grasp_cosim.sweep.study import Parameter, Study

OUTCOMES = [
    Outcome(0, {"a": 0.1, "b[1]": None, "c": True, "n": 3}),
    Outcome(7, {}, "plant: failed"),
    Outcome(12, {"a": float("inf")}),
]


@pytest.fixture
def study(grasp: System) -> Study:
    width = Parameter("width", ("plant.object_width",), Uniform(0.05, 0.07))
    return Study("made", grasp, (width,), Design("random", 20, 1))


def test_what_is_kept_is_there_again(study: Study, tmp_path: Path) -> None:
    store = Store(tmp_path / "new")
    assert store.open(study) == {}
    for outcome in OUTCOMES:
        store.keep(outcome)
    assert store.kept() == 3
    assert Store(tmp_path / "new").open(study) == {o.index: o for o in OUTCOMES}


def test_half_a_part_is_no_part(study: Study, tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.open(study)
    torn = tmp_path / "parts/0000003.json.99.part"
    torn.write_text('{"index": 3, "metr')
    theirs = tmp_path / "download.part"
    theirs.touch()
    assert store.open(study) == {}
    assert not torn.exists()
    assert theirs.exists()


def test_another_study_is_refused_in_one_line(study: Study, tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.open(study)
    with pytest.raises(InputError, match="has the runs of another study; --out must be") as caught:
        store.open(replace(study, design=Design("random", 21, 1)))
    assert len(str(caught.value).splitlines()) == 1
    fmu = tmp_path / "GripperPlant.fmu"
    fmu.write_bytes(study.system.component("plant", "").fmu.read_bytes() + b" ")
    with pytest.raises(InputError, match="the same study with other FMUs; --out must be"):
        store.open(replace(study, system=study.system.swap("plant", fmu)))


HOLD = """
import fcntl, sys, time
file = open(sys.argv[1], "w")
fcntl.flock(file, fcntl.LOCK_EX)
print(12345, file=file, flush=True)
print("locked", flush=True)
time.sleep(60)
"""


def test_a_folder_is_one_process_s_until_that_ends_however(tmp_path: Path) -> None:
    store = Store(tmp_path / "new")
    with store.locked():
        assert (tmp_path / "new/lock").read_text() == f"{os.getpid()}\n"
        with pytest.raises(InputError, match=rf"process {os.getpid()} is doing runs in it; must"):
            Store(tmp_path / "new").locked().__enter__()
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path / "new/lock")], stdout=subprocess.PIPE
    )
    with other:
        assert other.stdout
        assert other.stdout.readline() == b"locked\n"
        with pytest.raises(InputError, match="new: process 12345 is doing runs") as caught:
            store.locked().__enter__()
        assert "\n" not in str(caught.value)
        other.kill()
    with store.locked():
        assert store.kept() == 0


def test_the_lock_names_its_process_alone(tmp_path: Path) -> None:
    (tmp_path / "lock").write_text(f"{2**63}\n")
    with Store(tmp_path).locked():
        assert (tmp_path / "lock").read_text() == f"{os.getpid()}\n"


def test_a_part_that_cannot_be_written_is_one_line(study: Study, tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.open(study)
    store.keep(OUTCOMES[0])
    (tmp_path / "parts/0000007.json").mkdir()
    with pytest.raises(
        SimulationError, match=r"0000007.json: .*; 2 runs kept, the same command goes on$"
    ):
        store.keep(OUTCOMES[1])
    assert not list(tmp_path.rglob("*.part"))


PARTS = [
    '{"index": 2, "metrics": {}}',  # another run's
    '{"index": true, "metrics": {}}',
    '{"index": 1, "metrics": 3}',
    '{"index": 1, "metrics": {"a": [1]}}',
    '{"index": 1, "metrics": {}, "error": 3}',
    '{"index": 1, "metrics": {}, "more": 3}',
    "[" * 10_000,
    "",
]


@pytest.mark.parametrize("text", PARTS)
def test_a_part_that_is_no_run_is_refused(study: Study, tmp_path: Path, text: str) -> None:
    store = Store(tmp_path)
    store.open(study)
    (tmp_path / "parts/0000001.json").write_text(text)
    with pytest.raises(InputError, match=r"0000001.json: not readable as a run: .*must be removed"):
        store.open(study)


def test_a_run_beyond_the_last_is_refused(study: Study, tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.open(study)
    store.keep(Outcome(study.runs, {}))
    with pytest.raises(InputError, match=r"0000020.json: not readable as a run: index = 20; must"):
        store.open(study)


def test_what_is_not_ours_is_refused(study: Study, tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.open(study)
    (tmp_path / "parts/0000001.json").write_text("{}")
    with pytest.raises(InputError, match=r"0000001.json: not readable as a run: .*must be removed"):
        store.open(study)
    (tmp_path / "study.json").write_text("{")
    with pytest.raises(InputError, match=r"study.json: not readable"):
        store.open(study)
    (tmp_path / "study.json").write_text(json.dumps([1]))
    with pytest.raises(InputError, match="another study"):
        store.open(study)
    (tmp_path / "study.json").unlink()
    with pytest.raises(InputError, match=r"runs without study.json"):
        store.open(study)
