"""What the pages tell a user to type works, and their links lead somewhere."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import System, grasp_system, linearise
from grasp_cosim.base.registry import names
from grasp_cosim.grasp.presets import SYSTEM
from support.marks import needs_compiler

ROOT = Path(__file__).parents[2]
PAGES = {
    page.relative_to(ROOT).as_posix(): page.read_text("utf-8")
    for page in sorted(ROOT.rglob("*.md"))
    if not any(part.startswith(".") for part in page.relative_to(ROOT).parts)
}
README = PAGES["README.md"]


def blocks(page, kind):
    """The fenced blocks of a kind on a page."""
    return re.findall(rf"```{kind}\n(.*?)```", PAGES[page], re.DOTALL)


_, MAP, SOBOL, NOISE = blocks("docs/how_to/sweep.md", "python")
(FROM_PYTHON,) = blocks("docs/how_to/python_system.md", "python")


def as_script(text, folder):
    """What a text prints that is saved as a script, as it stands, and run."""
    (folder / "script.py").write_text(text, "utf-8")
    program = [sys.executable, "script.py"]
    done = subprocess.run(program, cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@needs_compiler
@pytest.mark.parametrize("page", ["docs/how_to/hand.md", "docs/how_to/tandem.md"])
def test_the_examples_of_another_gripper_hold(page, tmp_path):
    assert as_script("".join(blocks(page, "python")), tmp_path)


@needs_compiler
def test_the_loops_of_linear_analysis_are_as_shown(capsys):
    (example,) = blocks("docs/how_to/linear_analysis.md", "python")
    exec(example, names := {})
    printed = capsys.readouterr().out
    assert f"```\n{printed}```\n" in PAGES["docs/how_to/linear_analysis.md"]
    assert len(names["models"]) == printed.count("\n")


@needs_compiler
@pytest.mark.parametrize(
    "row",
    re.findall(r"^\| ([\d.]+) \| (\w+) \| (.*) \|$", PAGES["docs/how_to/linear_analysis.md"], re.M),
)
def test_the_margins_at_the_surface_are_as_shown(row):
    milliseconds, scheme, shown = row
    step, name = 1e-3 * float(milliseconds), "controller.intensity[1]"
    system = grasp_system().with_values({"plant.initial_object_position": 0.07499})
    found = linearise(system, 2 * step, [name], [name], step=step, scheme=scheme).margins()
    margins = f"{found.crossover:.1f} | {found.phase_margin:.1f} | {1e3 * found.delay_margin:.2f}"
    assert margins == shown


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "fewer", "printed"),
    [
        (MAP, {", 25)": ", 3)", ", 17)": ", 2)", "stop=6.0": "stop=0.5"}, ""),
        (SOBOL, {"n=64": "n=2"}, "first order"),
        (NOISE, {"* 20": "* 3"}, "] "),
    ],
    ids=["map", "sobol", "noise"],
)
def test_the_scripts_of_studies(script, fewer, printed, tmp_path):
    for text, less in fewer.items():
        assert text in script
        script = script.replace(text, less)
    assert printed in as_script(script, tmp_path)
    assert (tmp_path / "map.png").exists() == ("map.png" in script)


def test_the_preset_of_the_page_goes_into_a_system_file(checkout):
    (preset,) = blocks("docs/how_to/change_and_compare.md", "toml")
    text = SYSTEM.read_text("utf-8").replace('fmu = "', 'fmu = "fmus/build/')
    path = checkout / "my_system.toml"
    path.write_text(text + preset, encoding="utf-8")
    system = System.load(path).with_presets("dark")
    assert system.start("sensor_2.reflectance") == 0.3


def test_the_first_screen_has_a_picture_and_the_two_commands():
    first = "\n".join(README.splitlines()[:22])
    for shown in ("](docs/hand.svg)", "    make run ", "    make test "):
        assert shown in first
    assert "open `results/evaluation.html`" in first
    assert len(README.splitlines()) <= 90


@pytest.mark.slow
def test_make_run_ends_with_a_picture_and_three_commands():
    make = shutil.which("make")
    if make is None:
        pytest.skip("make is not installed")
    command = [make, "--no-print-directory", "-n", "run"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    printed = re.findall(r"^echo '(.*)'$", done.stdout, re.MULTILINE)
    assert printed[1].endswith("results/first_grasp/grasp.png")
    assert [line.split()[0] for line in printed[-3:]] == ["source", "grasp-cosim", "grasp-cosim"]
    shown = PAGES["docs/start/install.md"]
    assert "\n".join(printed[-3:]) in shown


def test_the_make_targets_are_those_of_contributing():
    (listed,) = re.findall(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text("utf-8"), re.M)
    named = {
        word
        for words in re.findall(r"`make ([a-z -]+)", PAGES["CONTRIBUTING.md"])
        for word in words.split()
    }
    assert named == {*listed.split()} - {"clean"}


# Links and words


def headings(text):
    """The anchors that GitHub gives the headings of a page."""
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    found = (re.sub(r"[`*]", "", line).lower() for line in re.findall(r"^#+ (.*)$", text, re.M))
    return {re.sub(r"[^\w\- ]", "", line).replace(" ", "-") for line in found}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    for link, heading in re.findall(r"\]\(([^)#\s]*)(?:#([^)]*))?\)", PAGES[page]):
        if link.startswith("http"):
            continue
        target = ROOT / page if link == "" else (ROOT / page).parent / link
        assert target.exists(), link
        if target.suffix == ".md" and heading:
            assert heading in headings(target.read_text("utf-8")), f"{link}#{heading}"


def test_from_the_readme_one_comes_to_every_page():
    reached = {"README.md"}
    while True:
        linked = {
            path.resolve().relative_to(ROOT).as_posix()
            for page in reached
            for link in re.findall(r"\]\(([^)#\s]+\.md)", PAGES[page])
            if (path := (ROOT / page).parent / link).resolve().is_relative_to(ROOT)
        }
        if linked <= reached:
            break
        reached |= linked
    assert reached == PAGES.keys()


def test_each_word_is_in_the_glossary_once():
    text = PAGES["docs/reference/glossary.md"]
    rows = [row.split(" | ")[0] for row in re.findall(r"^\| (.*)", text, re.M)]
    words = [word for row in rows if row != "word" for word in row.split(", ")]
    assert [word for word in words if words.count(word) > 1] == []
    missing = {
        *("peer", "host", "master", "communication step", "lockstep", "session", "watchdog"),
        *("failsafe", "overrun", "isolation", "engine", "swap", "tunable", "feedthrough"),
        *(
            "model exchange",
            "weight",
            "target position",
            "platform",
            "key",
            "test bench",
            "hold a value",
        ),
        *("O-RLI", "case", "layer", "proxy", "Jacobi", "SSP", "sequential", "role", "preset"),
        *("native twin", "contact", "stop time"),
    } - {*words}
    assert missing == set()


# Packages

PACKAGES = sorted(p.parent.name for p in (ROOT / "orchestrator/grasp_cosim").glob("*/__init__.py"))


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_states_its_input_its_output_and_the_file_to_read_first(package):
    folder = ROOT / "orchestrator/grasp_cosim" / package
    page = PAGES[f"orchestrator/grasp_cosim/{package}/README.md"]
    form = r"- \*\*Input\*\*: .+\n- \*\*Output\*\*: .+\n- \*\*Read first\*\*: `(.+?)`"
    assert (folder / re.search(form, page)[1]).exists()
    for cell in re.findall(r"^\| (`.*?`) \| ", page, re.MULTILINE):
        for name in re.findall(r"`(.+?)`", cell):
            assert (folder / name).exists()


def test_the_page_of_the_orchestrator_has_all_packages():
    text = PAGES["orchestrator/README.md"]
    rows = [line.split("`")[1].rstrip("/") for line in text.splitlines() if line.startswith("| [`")]
    assert sorted(rows) == PACKAGES
    assert names("groups") == ("grasp", "hand", "tandem")


def test_the_system_from_python_is_that_of_its_page():
    """Up to the object each finger obeys v' = force / mass, its force held from point to point."""
    names = {}
    exec(FROM_PYTHON, names)
    result, mass, step = names["result"], 0.5, 1e-3
    gain, share, speed = 20.0, step / 0.05, 0.05
    # velocity, integral and force of finger 2 at one point from those at the point before, and 1
    after = np.zeros((4, 4))
    after[0] = [1.0, 0.0, step / mass, 0.0]
    after[1] = [0.0, 1.0, 0.0, share * speed] - share * after[0]
    after[2] = gain * ([0.0, 0.0, 0.0, speed] - after[0] + after[1])
    after[3, 3] = 1.0
    start = np.array([0.0, 0.0, gain * speed, 1.0])
    for k in (1, 10, 200, 800):
        velocity, _, force, _ = np.linalg.matrix_power(after, k) @ start
        assert result["plant.velocity[2]"][k] == pytest.approx(velocity, rel=1e-9)
        assert result["controller.force[2]"][k] == pytest.approx(force, rel=1e-9, abs=1e-12)
    assert result["plant.velocity[1]"][800] == pytest.approx(-speed, rel=0.01)
    assert result.settings["changed"] == {"controller.gain": 20.0}
