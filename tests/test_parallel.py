"""Runs spread over processes."""

import os
from pathlib import Path

import pytest
from grasp_cosim.errors import InputError
from grasp_cosim.parallel import run_all


def _process(job: int) -> tuple[int, int]:
    return job, os.getpid()


def _refuse(job: Path) -> None:
    if job.name == "wrong":
        raise InputError(f"{job}: must be something else")
    job.touch()


def test_results_come_in_the_order_of_the_jobs_from_other_processes() -> None:
    results = list(run_all(_process, range(6), 2, progress=False, what="runs"))
    assert [job for job, _ in results] == list(range(6))
    assert os.getpid() not in {process for _, process in results}


def test_the_error_of_a_job_is_that_of_all(tmp_path: Path) -> None:
    jobs = [tmp_path / "right", tmp_path / "wrong"]
    with pytest.raises(InputError, match="wrong: must be something else"):
        list(run_all(_refuse, jobs, 1, progress=False, what="runs"))
    assert (tmp_path / "right").exists()
