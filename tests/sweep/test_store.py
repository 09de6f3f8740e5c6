"""The folder of a study: bound to it, and whole after whatever happened."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim import InputError, System
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
    assert store.open(study) == {}
    assert not torn.exists()


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
