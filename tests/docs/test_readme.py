"""The README and the guide: what they tell a user to type works."""

import re
import shlex
import shutil
import signal
import subprocess
from pathlib import Path

import pytest
from grasp_cosim import System, cli, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.hil.relay import Relay
from grasp_cosim.hil.server import Server
from grasp_cosim.master.compiled import has_compiler
from grasp_cosim.ssp.to_archive import write_ssp
from support.slow import slow

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text("utf-8")
GUIDE = (ROOT / "docs/guide.md").read_text("utf-8")
PAGES = f"{README}\n{GUIDE}"
COMMANDS = sorted(
    set(re.findall(r"^    \.venv/bin/(grasp-cosim .*?)(?:\s+#.*)?$", PAGES, re.MULTILINE))
)
LONG = ("--fmi 3", "--controller")
"""In the commands that take more than a moment."""

METRICS, *EXAMPLES = re.findall(r"```python\n(.*?)```", PAGES, re.DOTALL)
OUTPUTS = re.findall(r"```\n(\d+ steps of .*?)```", README, re.DOTALL)
TABLES = re.findall(r"```toml\n(.*?)```", PAGES, re.DOTALL)


@pytest.fixture(scope="session")
def recorded(grasp, tmp_path_factory):
    """The folder of a short run."""
    folder = tmp_path_factory.mktemp("recorded")
    result = simulate(grasp, step=1e-3, stop=0.1)
    result.to_csv(folder / "signals.csv")
    result.to_json(folder / "run.json")
    return folder


def _folder(path):
    path.mkdir(exist_ok=True)
    return path


@pytest.fixture
def user(checkout, grasp, recorded):
    """A checkout with a vendor's FMU, systems and a run of one's own."""
    shutil.copy(checkout / "fmus/build/GripperPlant.fmu", checkout / "vendor.fmu")
    text = SYSTEM.read_text("utf-8").replace('fmu = "', 'fmu = "fmus/build/')
    (checkout / "my_system.toml").write_text(text, encoding="utf-8")
    write_ssp(grasp, checkout / "my_system.ssp")
    (checkout / "my_metrics.py").write_text(METRICS, encoding="utf-8")
    for name in ("results", "other"):
        for written in ("signals.csv", "run.json"):
            shutil.copy(recorded / written, _folder(checkout / name))
    return checkout


def test_there_is_something_to_try():
    assert len(COMMANDS) == 26
    assert len(EXAMPLES) == 1


@pytest.mark.parametrize(
    "command", [slow(c) if any(word in c for word in LONG) else c for c in COMMANDS]
)
def test_command(user, command, monkeypatch):
    for kind, runs in ((Server, "serve"), (Relay, "run")):
        monkeypatch.setattr(kind, runs, lambda *_: signal.raise_signal(signal.SIGINT))
    arguments = shlex.split(command)
    if "--native" in arguments and not has_compiler():
        pytest.skip("there is no C compiler")
    if arguments[1] in ("run", "qualify"):
        arguments += ["--stop", "0.01"]
    if arguments[1] == "init":
        (user / "my_system.toml").unlink()
    if arguments[1] == "serve":
        arguments += ["--port", "0"]
    assert cli.main(arguments[1:]) == 0


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES)
def test_example(user, capsys, example):
    assert "stop=3.0" in example
    exec(example.replace("stop=3.0", "stop=2.0"), {})
    out = capsys.readouterr().out
    assert out.startswith("[1.")
    assert "] m\n0.2 (" in out
    assert "sensor_2.reflectance = 0.5" in out
    assert (user / "results/signals.csv").is_file()


@pytest.mark.slow
def test_what_a_run_ends_with(user, capsys):
    """All but how fast it was."""
    (shown,) = OUTPUTS
    assert cli.main(["run"]) == 0
    found = capsys.readouterr().out
    first, *rest = shown.splitlines()
    assert found.splitlines()[1:] == rest
    assert found.startswith(first.rpartition(", ")[0])


def test_the_scenario_runs(user):
    """The events and faults of the README, appended to a system of one's own."""
    (scenario,) = (table for table in TABLES if "[[events]]" in table)
    path = user / "my_system.toml"
    path.write_text(path.read_text("utf-8") + scenario, encoding="utf-8")
    log = simulate(System.load(path), step=1e-3, stop=1.2).log
    assert [line.partition(": ")[0] for line in log] == ["t = 0.5 s", "t = 0.5 s", "t = 1 s"]


def test_the_metric_of_the_readme(user, capsys):
    assert cli.main(["run", "--metrics", "my_metrics.py", "--step", "1e-3", "--stop", "2"]) == 0
    (shown,) = (s for s in capsys.readouterr().out.splitlines() if s.startswith("closing time"))
    assert 1.0 < float(shown.split()[2]) < 1.9


def test_the_preset_of_the_guide(user):
    (preset,) = (table for table in TABLES if "[presets.dark]" in table)
    path = user / "my_system.toml"
    path.write_text(path.read_text("utf-8") + preset, encoding="utf-8")
    system = System.load(path).with_presets("dark")
    assert system.start("sensor_2.reflectance") == 0.3


def test_the_keys_of_a_component_are_read(user):
    (keys,) = (table for table in TABLES if "[components.plant]" in table)
    keys = keys.replace("GapRight", "gap[1]").replace("GapLeft", "gap[2]")
    text = (user / "my_system.toml").read_text("utf-8")
    own = re.sub(r"\[components\.plant\]\n.*?\n(?=\n)", lambda _: keys, text, flags=re.DOTALL)
    (user / "my_system.toml").write_text(own, encoding="utf-8")
    plant = System.load(user / "my_system.toml").component("plant", "test")
    assert (plant.step_ns, plant.isolation, len(plant.rename)) == (1_000_000, "process", 2)


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


@pytest.mark.parametrize("card", sorted(ROOT.glob("*/README.md")), ids=lambda p: p.parent.name)
def test_links_in_the_readme_lead_to_every_card(card):
    assert f"]({card.relative_to(ROOT).as_posix()})" in README
