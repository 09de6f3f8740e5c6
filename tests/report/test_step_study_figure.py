"""The figure of a step study, whatever was found: one must always come out."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from grasp_cosim.convergence.step_study import StepRun, StepStudy
from grasp_cosim.report.step_study import draw_step_study

Times = tuple[float | None, float | None]


def _study(times: list[Times], energies: list[Mapping[str, float]]) -> StepStudy:
    names = ("first", "second")
    runs = (
        StepRun(100_000 * 2**i, dict(zip(names, pair, strict=True)), energy)
        for i, (pair, energy) in enumerate(zip(times, energies, strict=True))
    )
    return StepStudy("hand.toml", "sequential", 3.0, 200_000, 1e-3, "s", names, tuple(runs))


def _size(path: Path) -> tuple[int, int]:
    head = path.read_bytes()[:24]
    assert head.startswith(b"\x89PNG")
    return int.from_bytes(head[16:20]), int.from_bytes(head[20:24])


LINEAR: list[Times] = [(1.0 + 1e-3 * 2**i, 1.1 - 2e-3 * 2**i) for i in range(5)]
NOTHING: list[Times] = [(None, None)] * 5
ENERGY = {"plant.exchange_energy[1]": 1e-6, "plant.exchange_energy[2]": -1e-7}


FIRST_ONLY: list[Times] = [(1.0, None), *NOTHING[1:]]
LAST_MISSING: list[Times] = [*LINEAR[:4], (None, None)]


@pytest.mark.parametrize("times", [LINEAR, NOTHING, [(1.0, None)] * 5, FIRST_ONLY, LAST_MISSING])
def test_any_quantities_can_be_drawn(times: list[Times], tmp_path: Path) -> None:
    draw_step_study(_study(times, [{}] * 5), tmp_path / "study.png")
    assert [p.name for p in tmp_path.iterdir()] == ["study.png"]
    assert _size(tmp_path / "study.png")[0] == 936


def test_energies_have_a_panel_of_their_own(tmp_path: Path) -> None:
    draw_step_study(_study(LINEAR, [{}] * 5), tmp_path / "without.png")
    draw_step_study(_study(LINEAR, [ENERGY] * 5), tmp_path / "with.png")
    assert _size(tmp_path / "with.png")[1] > 1.5 * _size(tmp_path / "without.png")[1]


def test_an_energy_of_zero_is_not_drawn(tmp_path: Path) -> None:
    nothing = {"plant.exchange_energy[1]": 0.0}
    draw_step_study(_study(LINEAR, [nothing] * 5), tmp_path / "zero.png")
    draw_step_study(_study(LINEAR, [{}] * 5), tmp_path / "without.png")
    assert (tmp_path / "zero.png").read_bytes() == (tmp_path / "without.png").read_bytes()


@pytest.mark.slow
def test_the_same_study_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one.png", "two.png"):
        draw_step_study(_study(LINEAR, [ENERGY] * 5), tmp_path / name)
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
