"""Each picture in docs is the one that docs/pictures.py makes; the hand moves as recorded."""

import importlib
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import simulate
from report.javascript import in_browser
from support.grasps import CASES
from support.marks import only_whole
from support.pictures import assert_same_picture

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def pictures(checkout, monkeypatch):
    """The script that makes them, in a checkout."""
    monkeypatch.syspath_prepend(DOCS)
    module = importlib.import_module("pictures")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", module.tutorials.DATE)
    return module


def test_each_picture_has_a_command(pictures):
    made = [picture for _, files in pictures.PICTURES.values() for picture in files]
    there = [path.name for kind in ("png", "svg") for path in DOCS.glob(f"*.{kind}")]
    assert sorted(made) == sorted(there)


def test_each_picture_is_shown_somewhere():
    pages = [DOCS.parent / "README.md", *DOCS.rglob("*.md")]
    shown = {
        (page.parent / link).resolve()
        for page in pages
        for link in re.findall(r"!\[[^]]*\]\(([^)]*)\)", page.read_text("utf-8"))
    }
    assert shown == {path for kind in ("png", "svg") for path in DOCS.glob(f"*.{kind}")}


def test_a_name_that_is_none(pictures):
    with pytest.raises(SystemExit, match=r"^hnad: must be of hand, first, three, tandem, loop, "):
        pictures.main("hand", "hnad")


@pytest.mark.slow
@pytest.mark.campaign
@pytest.mark.parametrize(
    "name",
    [
        *(
            "hand",
            "three",
            "tandem",
            "loop",
            "three_layers",
            "evaluation",
            "report",
            "layer_2",
            "delicate",
        ),
        pytest.param("maps", marks=only_whole("takes more than a minute")),
    ],
)
def test_it_is_the_one_that_the_command_makes(pictures, tmp_path, name):
    """Those of tutorial pages: test_tutorials.py."""
    if name == "report" and not (shutil.which("chromium") or shutil.which("chromium-browser")):
        pytest.skip("chromium is not installed")
    draw, files = pictures.PICTURES[name]
    folder = tmp_path / "drawn"
    folder.mkdir()
    draw(folder)
    assert {path.name for path in folder.iterdir()} == {*files}
    for path in folder.iterdir():
        assert_same_picture(path, DOCS / path.name, "make pictures")


@pytest.mark.slow
def test_that_of_a_timing_is_never_twice_the_same_but_as_large(pictures, tmp_path):
    image = pytest.importorskip("matplotlib.image")
    pictures.draw_timing(tmp_path)
    new, kept = (image.imread(folder / "timing.png") for folder in (tmp_path, DOCS))
    assert new.shape == kept.shape


HAND = (DOCS / "hand.svg").read_text("utf-8")
PAGE = f"""
<html data-ready="yes"><head></head><body><script>const recording = {{}};</script>{HAND}
</body></html>
"""


def test_it_is_small_and_asks_for_nothing():
    assert len(HAND) < 300_000
    assert not re.search(r"<script|href|url\(|@import", HAND)


@pytest.mark.slow
def test_the_fingers_are_where_they_were_recorded(grasp, tmp_path):
    """By the browser's own reckoning, at any time, also between keyframes; at 2200 px a m."""
    times = [0.0, 0.31, 1.0, 1.234, 1.9, 2.5, 3.0, 4.2]
    body = f"""
      const moving = document.getAnimations(), seen = {{}};
      for (const t of {times}) {{
        for (const one of moving) {{
          one.pause();
          one.currentTime = 1000 * t;
        }}
        for (const {{ effect: {{ target }} }} of moving) {{
          const style = getComputedStyle(target), at = new DOMMatrix(style.transform);
          (seen[target.id] ??= []).push([at.e, at.a, Number(style.opacity)]);
        }}
      }}
      return seen;
    """
    seen = {name: np.array(rows) for name, rows in in_browser(PAGE, body, tmp_path).items()}
    assert len(seen) == 17
    for row, case in enumerate((1, 2)):
        run = simulate(grasp.with_values(CASES[case]), step=1e-3)
        for j in (1, 2):
            x = np.interp(times, run.time, run[f"plant.position[{j}]"])
            assert seen[f"f{row}{j}"][:, 0] == pytest.approx(320.0 + 2200.0 * x, abs=1.0)
            force = np.interp(times, run.time, abs(run[f"plant.contact_force[{j}]"]))
            settled = [0, 1, 2, 6, 7]  # beside the impacts
            bar = abs(seen[f"n{row}{j}"][settled, 1])
            assert bar == pytest.approx(14.0 * force[settled], abs=1.0)
            touch = run.metrics["time_to_contact"][j - 1]
            assert seen[f"l{row}{j}"][:, 2].tolist() == [float(t > touch) for t in times]


@pytest.mark.slow
def test_it_stands_still_at_the_end_where_no_motion_is_wanted(tmp_path):
    body = """
      const at = (id) => new DOMMatrix(getComputedStyle(document.getElementById(id)).transform).e;
      return [document.getAnimations().length, at("f11"), at("f12")];
    """
    still = in_browser(PAGE, body, tmp_path, still=True)
    assert still == [0, pytest.approx(320 + 2200 * 0.065, abs=1), pytest.approx(309, abs=1)]
