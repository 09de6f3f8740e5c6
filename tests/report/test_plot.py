"""The picture of any result: its signals by unit."""

from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim.report import plot
from matplotlib.figure import Figure
from report.runs import ring_run


@pytest.fixture
def saved(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Collects the figures that are saved."""
    figures: list[Figure] = []
    save = plot.save

    def keep(figure: Figure, path: Path) -> None:
        figures.append(figure)
        save(figure, path)

    monkeypatch.setattr(plot, "save", keep)
    return figures


def test_all_signals_by_unit(tmp_path: Path, saved: list[Figure]) -> None:
    run = ring_run([f"c{k}" for k in range(15)])
    units = {name: "m" if name < "c1" else None for name in run.signals}
    plot.plot_signals(replace(run, units=units), tmp_path / "signals.png")
    metres, none = saved[0].axes
    assert (metres.get_ylabel(), none.get_ylabel()) == ("in m", "no unit")
    assert [len(a.lines) for a in (metres, none)] == [1, 14]
    assert metres.get_legend() is not None
    assert none.get_legend() is None  # it would hide the lines
    assert (tmp_path / "signals.png").exists()
