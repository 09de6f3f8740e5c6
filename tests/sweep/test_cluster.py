"""The same study on a Dask cluster on this machine: the same bits."""

import sys
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.sweep.cluster import run_on_cluster, ship, unpacked
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.distributions import Uniform
from grasp_cosim.sweep.run import Job, Task, run_job
from grasp_cosim.sweep.study import Parameter, Study
from grasp_cosim.sweep.sweep import sweep


@pytest.fixture
def study(grasp: System) -> Study:
    width = Parameter("width", ("plant.object_width",), Uniform(0.05, 0.07))
    case_0 = {"controller.impact_reduction.enabled": False}
    system = grasp.with_values(case_0).with_experiment(step=1e-3, stop=0.3)
    return Study("made", system, (width,), Design("random", 6, 1))


def test_a_shipment_is_the_task(study: Study) -> None:
    task = Task(study.system, ("plant.object_position",))
    there = unpacked(ship(task))
    for ours, theirs in zip(task.system.components, there.system.components, strict=True):
        assert ours.fmu != theirs.fmu
        assert ours.fmu.read_bytes() == theirs.fmu.read_bytes()
        assert (ours.name, ours.values) == (theirs.name, theirs.values)
    assert unpacked(ship(task)) == there
    job = Job(3, study.values(3))
    assert run_job(there, job) == run_job(task, job)


@pytest.mark.slow
def test_a_local_cluster_gives_the_same_bits(study: Study, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="dask is not installed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=2, dashboard_address="127.0.0.1:0", host="127.0.0.1"
    ) as cluster:
        address = cluster.scheduler_address
        jobs = (Job(k, study.values(k)) for k in range(study.runs))
        with closing(run_on_cluster(address, Task(study.system, ()), jobs)) as outcomes:
            early = next(outcomes)  # the others are cancelled
        there = sweep(study, tmp_path / "there", scheduler=address)
    here = sweep(study, tmp_path / "here", workers=2)
    assert here.failed == 0
    assert there.outcomes == here.outcomes
    assert early == here.outcomes[early.index]
    files = [tmp_path / name / "runs.parquet" for name in ("there", "here")]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_without_dask_it_is_said(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'distributed>="):
        sweep(study, tmp_path / "out", scheduler="tcp://127.0.0.1:8786")


def test_a_client_that_fails_without_a_word_is_named(
    study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    def client(*_: object, **__: object) -> None:
        raise TimeoutError

    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=client))
    with pytest.raises(
        InputError, match="--scheduler tcp://x: TimeoutError; must be one that runs"
    ):
        list(run_on_cluster("tcp://x", Task(study.system, ()), [Job(0, {})]))


def test_an_address_that_is_none(study: Study, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="dask is not installed")
    with pytest.raises(InputError, match=r"--scheduler nonsense://x: .*; must be one that runs"):
        sweep(study, tmp_path / "out", scheduler="nonsense://x")
