"""A release: the same bytes twice, whole, and its files work by themselves."""

import re
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from grasp_cosim import System, grasp_system, hand_system, simulate
from release import into_your_tool

SCRIPT = Path(__file__).parents[2] / "docs/release.py"


@pytest.fixture(scope="module")
def releases(tmp_path_factory):
    """Two of them, the second without anything that the first left behind."""
    pytest.importorskip("ziglang", reason="ziglang is not installed")
    folder = tmp_path_factory.mktemp("releases")
    for name in ("one", "two"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("XDG_CACHE_HOME", str(folder / f"cache of {name}"))
            subprocess.run([sys.executable, SCRIPT, folder / name], check=True)
    return folder


@pytest.mark.platforms
def test_it_is_the_same_to_the_byte_and_whole(releases):
    one, two = releases / "one", releases / "two"
    files = [path.relative_to(one) for path in sorted(one.rglob("*")) if path.is_file()]
    assert [path.relative_to(two) for path in sorted(two.rglob("*")) if path.is_file()] == files
    assert [f for f in files if (one / f).read_bytes() != (two / f).read_bytes()] == []
    subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=one, check=True)
    page = (one / "index.html").read_text("utf-8")
    named = {*re.findall(r'href="([^"]*)"', page)}
    assert named - {f"#{name}" for name in re.findall(r'id="([^"]*)"', page)} == {
        file.as_posix() for file in files if file.name != "index.html"
    }
    for path in (one / "fmi2").glob("*.fmu"):
        assert f"<td>{path.stem}<td>" in page


def test_what_the_page_tells_of_tools_links_nowhere_and_names_the_sources():
    text = into_your_tool()
    assert "href=" not in text
    assert "make dist" not in text
    named = set(re.findall(r"\(<code>([^<]*\.(?:md|svg))</code>\)", text))
    assert {"docs/how_to/hardware.md", "docs/loop.svg", "plant/README.md"} <= named
    assert [name for name in named if not (SCRIPT.parents[1] / name).is_file()] == []


@pytest.mark.platforms
@pytest.mark.parametrize(
    ("name", "like"),
    [
        ("grasp", grasp_system),
        ("grasp_adaptive", lambda: grasp_system("adaptive")),
        ("hand", lambda: hand_system(3, controller="adaptive")),
    ],
)
def test_an_archive_is_the_grasp(releases, name, like):
    system = System.load(releases / f"one/ssp/{name}.ssp")
    found, expected = (simulate(s, step=1e-3, stop=0.5) for s in (system, like()))
    assert expected.signals.keys() == found.signals.keys()
    for signal, values in expected.signals.items():
        assert np.array_equal(found.signals[signal], values), signal


@pytest.mark.platforms
@pytest.mark.parametrize("kind", ["fmi2", "fmi3", "python"])
def test_fmpy_runs_an_fmu(releases, kind):
    found = fmpy.simulate_fmu(
        releases / f"one/{kind}/ProximitySensor.fmu", start_values={"gap": 0.02}, stop_time=0.01
    )
    assert found["intensity"][-1] == pytest.approx(0.0024 / 0.025**1.1506, rel=1e-12)
