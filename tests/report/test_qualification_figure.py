"""The figure of a qualification is drawn whatever the runs are like."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import System
from grasp_cosim.qualification.bands import Band
from grasp_cosim.qualification.compared import Compared
from grasp_cosim.qualification.qualify import Qualification
from grasp_cosim.qualification.swap import Swap
from grasp_cosim.qualification.tube import Curve
from grasp_cosim.report.qualification import ROWS, draw_qualification
from support.slow import slow

pytest.importorskip("matplotlib")

TIME = np.linspace(0.0, 1.0, 101, dtype=np.float64)


def qualification(grasp: System, names: int, end: int = 101) -> Qualification:
    """Sines apart by 0.1, and as the last signal a contact; the candidate's run has end samples."""
    signals = [f"plant.signal[{i}]" for i in range(names)]
    original = {n: Curve(TIME, np.sin(6.0 * TIME + i)) for i, n in enumerate(signals)}
    original[signals[-1]] = Curve(TIME, (TIME > 0.5).astype(np.float64), held=True)
    candidate = {n: Curve(TIME[:end], c.values[:end] + 0.1, c.held) for n, c in original.items()}
    worst = float(min(TIME[end - 1], 0.3))
    compared = [
        Compared(n, "m", Band(0.05, 0.01, "derived"), 0.1, 0.0, 0.1, time=worst, span=2.0)
        for n in signals
    ]
    swap = Swap(grasp, "plant", Path("candidate.fmu"), (), grasp, {}, {})
    return Qualification(swap, tuple(compared), runs=(original, candidate))


@pytest.mark.parametrize(("names", "end"), [(1, 101), slow(2, 40), slow(ROWS + 3, 101), slow(3, 1)])
def test_it_is_drawn(grasp: System, tmp_path: Path, names: int, end: int) -> None:
    path = tmp_path / "qualification.png"
    draw_qualification(qualification(grasp, names, end), path)
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_band_without_end_is_not_drawn(grasp: System, tmp_path: Path) -> None:
    found = qualification(grasp, 2)
    loose = [replace(c, band=Band(np.inf, 0.01, "given")) for c in found.signals]
    draw_qualification(replace(found, signals=tuple(loose)), tmp_path / "loose.png")
    assert (tmp_path / "loose.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_same_qualification_is_the_same_picture(grasp: System, tmp_path: Path) -> None:
    found = qualification(grasp, 2)
    for name in ("a.png", "b.png"):
        draw_qualification(found, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
