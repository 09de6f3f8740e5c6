"""What the pages tell a user to type works, and their links lead somewhere."""

import re
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import System, cli, grasp_system, linearise, simulate
from grasp_cosim.base.registry import names
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.hil.relay import Relay
from grasp_cosim.hil.server import Server
from grasp_cosim.master.engine import has_compiler
from grasp_cosim.ssp.to_archive import write_ssp
from support.marks import needs_compiler, slow

ROOT = Path(__file__).parents[2]
PAGES = {
    page.relative_to(ROOT).as_posix(): page.read_text("utf-8")
    for page in sorted(ROOT.rglob("*.md"))
    if not any(part.startswith(".") for part in page.relative_to(ROOT).parts)
}
README, GUIDE = PAGES["README.md"], PAGES["docs/guide.md"]
COMMANDS = sorted(
    set(re.findall(r"^    \.venv/bin/(grasp-cosim .*?)(?:\s+#.*)?$", README + GUIDE, re.M))
)
LONG = ("--fmi 3", "--controller")
"""In the commands that take more than a moment."""


def blocks(page, kind):
    """The fenced blocks of a kind on a page."""
    return re.findall(rf"```{kind}\n(.*?)```", PAGES[page], re.DOTALL)


METRIC, FROM_PYTHON = blocks("docs/guide.md", "python")
MAP, SOBOL, NOISE = blocks("docs/how_to/sweep.md", "python")


@pytest.fixture(scope="session")
def recorded(grasp, tmp_path_factory):
    """The folder of a short run."""
    folder = tmp_path_factory.mktemp("recorded")
    result = simulate(grasp, step=1e-3, stop=0.1)
    result.to_csv(folder / "signals.csv")
    result.to_json(folder / "run.json")
    return folder


@pytest.fixture
def user(checkout, grasp, recorded):
    """A checkout with a vendor's FMU, systems and runs of one's own."""
    shutil.copy(checkout / "fmus/build/GripperPlant.fmu", checkout / "vendor.fmu")
    text = SYSTEM.read_text("utf-8").replace('fmu = "', 'fmu = "fmus/build/')
    (checkout / "my_system.toml").write_text(text, encoding="utf-8")
    write_ssp(grasp, checkout / "my_system.ssp")
    (checkout / "my_metrics.py").write_text(METRIC, encoding="utf-8")
    for name in ("results", "other"):
        shutil.copytree(recorded, checkout / name)
    return checkout


@pytest.mark.parametrize(
    "command", [slow(c) if any(word in c for word in LONG) else c for c in COMMANDS]
)
def test_command(user, command, monkeypatch):
    for kind, runs in ((Server, "serve"), (Relay, "run")):
        monkeypatch.setattr(kind, runs, lambda *_: signal.raise_signal(signal.SIGINT))
    arguments = shlex.split(command)[1:]
    if "--native" in arguments and not has_compiler():
        pytest.skip("there is no C compiler")
    more = {"run": ["--stop", "0.01"], "qualify": ["--stop", "0.01"], "serve": ["--port", "0"]}
    if arguments[0] == "init":
        (user / "my_system.toml").unlink()
    assert cli.main([*arguments, *more.get(arguments[0], [])]) == 0


def test_there_is_something_to_try():
    assert len(COMMANDS) == 26


@pytest.mark.slow
def test_the_example_of_the_readme(user, capsys):
    (example,) = blocks("README.md", "python")
    exec(example, {})
    assert re.match(r"\[1\.\d+, 1\.\d+\] m\n", capsys.readouterr().out)
    assert (user / "results/grasp.png").is_file()


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
        (SOBOL, {"n=64": "n=2"}, "alone"),
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


@pytest.mark.slow
def test_what_a_run_ends_with(user, capsys):
    """All but how fast it was."""
    (shown,) = re.findall(r"```\n(\d+ steps of .*?)```", GUIDE, re.DOTALL)
    assert cli.main(["run"]) == 0
    found = capsys.readouterr().out
    first, *rest = shown.splitlines()
    assert found.splitlines()[1:] == rest
    assert found.startswith(first.rpartition(", ")[0])


def test_the_tables_of_the_guide_go_into_a_system_file(user):
    preset, scenario = blocks("docs/guide.md", "toml")
    path = user / "my_system.toml"
    path.write_text(path.read_text("utf-8") + preset + scenario, encoding="utf-8")
    system = System.load(path)
    assert system.with_presets("dark").start("sensor_2.reflectance") == 0.3
    log = simulate(system, step=1e-3, stop=1.2).log
    assert [line.partition(": ")[0] for line in log] == ["t = 0.5 s", "t = 0.5 s", "t = 1 s"]


def test_the_metric_of_the_guide(user, capsys):
    assert cli.main(["run", "--metrics", "my_metrics.py", "--step", "1e-3", "--stop", "2"]) == 0
    (shown,) = (s for s in capsys.readouterr().out.splitlines() if s.startswith("closing time"))
    assert 1.0 < float(shown.split()[2]) < 1.9


@pytest.mark.slow
def test_the_first_screen_is_the_hand_and_two_commands_of_which_one_ends_with_it_moving():
    """Within 25 lines of the README; `make run` ends with where the page is."""
    first = "\n".join(README.splitlines()[:25])
    for shown in ("](docs/hand.svg)", "    make run ", "    make test ", "](docs/loop.svg)"):
        assert shown in first
    make = shutil.which("make")
    if make is None:
        pytest.skip("make is not installed")
    command = [make, "--no-print-directory", "-n", "run"]  # which `make test` would have printed
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1].endswith("docs/playground.html'")
    assert "then open results/evaluation.html" in first


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
    rows = [
        row.split(" | ")[0]
        for row in re.findall(r"^\| (.*)", PAGES["docs/reference/glossary.md"], re.M)
    ]
    words = [word for row in rows if row != "word" for word in row.split(", ")]
    assert len(set(words)) == len(words)
    asked = {"O-RLI", "case", "layer", "bench", "proxy", "Jacobi", "SSP", "sequential", "role"}
    assert asked | {"preset", "native twin", "contact"} <= set(words)


# Rooms

ROOMS = sorted(p.parent.name for p in (ROOT / "orchestrator/grasp_cosim").glob("*/__init__.py"))


@pytest.mark.parametrize("room", ROOMS)
def test_a_card_says_what_comes_in_what_goes_out_and_what_to_read(room):
    card = PAGES[f"orchestrator/grasp_cosim/{room}/README.md"]
    says = r"- \*\*Comes in\*\*: .+\n- \*\*Goes out\*\*: .+\n- \*\*Read first\*\*: `(.+?)`"
    assert (ROOT / f"orchestrator/grasp_cosim/{room}" / re.search(says, card)[1]).exists()


def test_the_map_has_all_rooms():
    text = PAGES["orchestrator/README.md"]
    rows = [line.split("`")[1].rstrip("/") for line in text.splitlines() if line.startswith("| [`")]
    assert sorted(rows) == ROOMS
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
