"""An evaluation that is broken off goes on, and comes to the same files."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from conftest import MadeOnce
from grasp_cosim import InputError, System
from grasp_cosim.grasp.presets import CASES, SYSTEM
from grasp_cosim.grasp.published import evaluate as module
from grasp_cosim.grasp.published.evaluate import evaluate
from grasp_cosim.grasp.published.grasps import Run
from grasp_cosim.grasp.published.store import FOLDER, SIGNALS
from grasp_cosim.parallel import run_all
from grasp_cosim.sweep.store import Parts

pytestmark = pytest.mark.slow

SHOWN = 10
"""So many grasps include some that the figures show."""

Keep = Callable[[int, Run], None]


@pytest.fixture(scope="session")
def coarse(natives: Path) -> System:
    return System.load(SYSTEM, natives).with_experiment(step=1e-3)


@pytest.fixture(scope="session")
def at_once(coarse: System, made_once: MadeOnce) -> Path:
    """What an evaluation writes that nobody breaks off."""

    def fill(folder: Path) -> None:
        evaluate(coarse, folder, workers=2, progress=False)

    return made_once("evaluate_at_once", fill)


def interrupted_after(
    count: int, done: list[int], system: System, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An evaluation that Ctrl-C ends after so many grasps."""

    def some(run: Callable[[Any], Run], jobs: Sequence[Any], *options: Any) -> list[Run]:
        *_, keep = options
        for index, job in enumerate(jobs[:count]):
            keep(index, run(job))
            done.append(index)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(module, "run_all", some)
        with pytest.raises(KeyboardInterrupt):
            evaluate(system, out, workers=1, progress=False)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_it_goes_on_and_comes_to_the_same(
    coarse: System, at_once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[int] = []
    for count in (SHOWN, 2):
        interrupted_after(count, done, coarse, tmp_path, monkeypatch)
        assert Parts(tmp_path / FOLDER).kept() == len(done)
    (tmp_path / FOLDER / "parts/0000012.json").write_text("{torn")
    shown = next((tmp_path / FOLDER).glob(f"parts/*/{SIGNALS}"))
    shown.write_bytes(shown.read_bytes()[:1000])
    jobs: list[int] = []

    def counted(run: Any, left: Sequence[Any], *options: Any) -> list[Run]:
        jobs.append(len(left))
        return run_all(run, left, *options)

    monkeypatch.setattr(module, "run_all", counted)
    evaluate(coarse, tmp_path, workers=2, progress=False)
    assert jobs == [len(CASES) * 6 - SHOWN - 2 + 1]
    assert contents(tmp_path) == contents(at_once)


def test_grasps_of_another_system_are_done_again(
    coarse: System, at_once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = coarse.with_values({"plant.object_width": 0.06})
    interrupted_after(3, [], other, tmp_path, monkeypatch)
    evaluate(coarse, tmp_path, workers=2, progress=False)
    assert contents(tmp_path) == contents(at_once)


def test_one_that_has_not_begun_leaves_nothing(
    coarse: System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupted_after(0, [], coarse, tmp_path, monkeypatch)
    assert not list(tmp_path.iterdir())


def test_two_at_a_time_are_refused(coarse: System, tmp_path: Path) -> None:
    with Parts(tmp_path / FOLDER).locked(), pytest.raises(InputError, match="is doing runs in it"):
        evaluate(coarse, tmp_path, workers=1, progress=False)
