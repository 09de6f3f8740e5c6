"""What the README tells a user to type works."""

import re
import shlex
import shutil
from pathlib import Path

import pytest
from grasp_cosim import System, cli
from grasp_cosim.grasp import SYSTEM

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")
COMMANDS = re.findall(r"^    \.venv/bin/(grasp-cosim .*?)(?:\s+#.*)?$", README, re.MULTILINE)
EXAMPLES = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.fixture
def checkout(tmp_path: Path, fmus: Path, grasp: System, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder like the repository: built FMUs, a vendor's FMU, a system of one's own."""
    (tmp_path / "orchestrator").symlink_to(ROOT / "orchestrator")
    shutil.copytree(fmus, tmp_path / "fmus/build")
    shutil.copy(fmus / "GripperPlant.fmu", tmp_path / "vendor.fmu")
    text = SYSTEM.read_text("utf-8").replace('fmu = "', 'fmu = "fmus/build/')
    (tmp_path / "my_system.toml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for module in ("frame", "evaluate"):
        monkeypatch.setattr(f"grasp_cosim.cli.{module}.grasp_system", lambda: grasp)
    return tmp_path


def test_there_is_something_to_try() -> None:
    assert len(COMMANDS) == 9
    assert len(EXAMPLES) == 1


@pytest.mark.parametrize("command", COMMANDS)
def test_command(checkout: Path, command: str) -> None:
    arguments = shlex.split(command)
    if arguments[1] == "run":
        arguments += ["--stop", "0.01"]
    assert cli.main(arguments[1:]) == 0


@pytest.mark.parametrize("example", EXAMPLES)
def test_example(checkout: Path, capsys: pytest.CaptureFixture[str], example: str) -> None:
    assert "stop=3.0" in example
    exec(example.replace("stop=3.0", "stop=2.0"), {})
    out = capsys.readouterr().out
    assert out.startswith("[1.")
    assert out.endswith("] m\n")
    assert (checkout / "results/signals.csv").is_file()


def test_pictures_exist() -> None:
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", README)
    assert pictures
    assert all((ROOT / picture).is_file() for picture in pictures)


@pytest.mark.parametrize("card", sorted(ROOT.glob("*/README.md")), ids=lambda p: p.parent.name)
def test_links_in_the_readme_lead_to_every_card(card: Path) -> None:
    assert f"]({card.relative_to(ROOT).as_posix()})" in README
