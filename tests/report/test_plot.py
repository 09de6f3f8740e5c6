"""The picture of any result: its signals by unit."""

from dataclasses import replace

import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.report import plot
from report.runs import ring_run


@pytest.fixture
def saved(monkeypatch):
    """Collects the figures that are saved."""
    figures = []
    save = plot.save_figure

    def keep(figure, path):
        figures.append(figure)
        save(figure, path)

    monkeypatch.setattr(plot, "save_figure", keep)
    return figures


def test_all_signals_by_unit_and_six_in_a_panel(tmp_path, saved):
    run = ring_run([f"c{k}" for k in range(15)])
    units = {name: "m" if name < "c1" else None for name in run.signals}
    plot.plot_signals(replace(run, units=units), tmp_path / "signals.png")
    metres, *others = saved[0].axes
    assert [axes.get_ylabel() for axes in (metres, *others)] == ["in mm", *["no unit"] * 3]
    assert [len(a.lines) for a in (metres, *others)] == [1, 6, 6, 2]
    assert metres.lines[0].get_ydata() == pytest.approx(1e3 * run.signals["c0.y"])
    for axes in (metres, *others):
        legend = axes.get_legend()
        assert legend is not None
        assert [text.get_text() for text in legend.get_texts()] == [
            line.get_label() for line in axes.lines
        ]
        looks = {(line.get_color(), line.get_linestyle()) for line in axes.lines}
        assert len(looks) == len(axes.lines)


@pytest.mark.parametrize(
    ("suffix", "begins"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF"), ("SVG", b"<?")]
)
def test_the_suffix_says_the_format_and_the_bytes_are_the_same(suffix, begins, tmp_path):
    run = ring_run(["a", "b"])
    both = [tmp_path / f"{name}.{suffix}" for name in ("one", "two")]
    for path in both:
        run.plot(path, title="Ring & <b>")
    one, two = (path.read_bytes() for path in both)
    assert one.startswith(begins)
    assert one == two
    for trace in (b"CreationDate", b"<dc:date>"):
        assert trace.lower() not in one.lower()


@pytest.mark.parametrize("name", ["ring.jpg", "ring"])
def test_another_suffix_is_refused(name, tmp_path):
    with pytest.raises(InputError, match=rf"{name}: must end in \.png, \.svg, \.pdf$"):
        ring_run(["a"]).plot(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_of_many_signals_a_picture_has_those_that_matter(tmp_path):
    run = ring_run([f"m{k:03}" for k in range(1000)])
    ends = {"from": "m999.y", "to": "m998.y", "factor": None, "offset": None}
    run = replace(run, settings={**run.settings, "connections": [ends], "changed": {}})
    figure = plot.plot_signals(run)
    drawn = {line.get_label() for axes in figure.axes for line in axes.lines}
    assert len(drawn) == plot.MAX_SIGNALS
    assert {"m999.y", "m998.y", "m000.y"} <= drawn
    assert "964 more signals: the page of `report`" in [t.get_text() for t in figure.texts][-1]
    figure = plot.plot_signals(run, of=["m500.y"])
    assert [line.get_label() for axes in figure.axes for line in axes.lines] == ["m500.y"]
