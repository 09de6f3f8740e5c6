"""Tables and pictures of the explanations and of python_block.md are those of their commands."""

import importlib.util
import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import cli, simulate
from grasp_cosim.fmu_export.contract import declared
from grasp_cosim.fmu_export.shipped import blocks
from grasp_cosim.inspection.block_templates import TEMPLATE_FOLDER
from grasp_cosim.recording.read_back import load_run
from support.pages import BLOCKS, INDENTED, commands_of, fill_in
from support.pictures import assert_same_picture

DOCS = Path(__file__).parents[2] / "docs"


def page(name):
    return (DOCS / f"{name}.md").read_text("utf-8")


def checked(name, checkout):
    """The runs of the tables of a page, whose cells and pictures must be those of the runs.

    The cells must be the same to the printed digit: the runs are deterministic.
    """
    spec = importlib.util.spec_from_file_location("tutorials", DOCS / "tutorials.py")
    tutorials, text = importlib.util.module_from_spec(spec), page(name)
    spec.loader.exec_module(tutorials)
    drawn = checkout / "drawn"
    drawn.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", tutorials.DATE)
        found, tables = tutorials.worked_out(text, tutorials.recorder(checkout / "recorded"))
        assert found == text, "run: docs/pictures.py"
        tutorials.PAGES[name](tables, drawn)
    pictures = sorted(p.name for p in drawn.iterdir())
    assert sorted({Path(p).name for p in re.findall(r"!\[.*?\]\((.*?png)\)", text)}) == pictures
    for picture in pictures:
        assert_same_picture(drawn / picture, DOCS / picture, "docs/pictures.py")
    return tables


@pytest.mark.slow
def test_the_commands_at_the_beginnings_work(checkout):
    pages = ("explanation/method", "explanation/limits", "how_to/python_block")
    commands = INDENTED.findall("\n".join(map(page, pages)))
    assert {command.split()[1] for command in commands} == {"init", "build", "run"}
    for command in commands:
        short = ["--stop", "0.01"] if command.split()[1] == "run" else []
        assert cli.main([*shlex.split(command)[1:], *short]) == 0, command
    assert (checkout / "case_0/grasp.png").is_file()


@pytest.mark.slow
@pytest.mark.campaign
def test_method(checkout):
    """And what layer 1 gives, worked out here once more."""
    cases, _, _, cup = checked("explanation/method", checkout)
    force = 98.0 * 0.035  # layer 1's spring over half the width
    steady = cases["--case 0"].metrics["steady_contact_force"]
    assert steady == pytest.approx([force, force], abs=1e-6)
    squeeze = 2.0 * force / (98.0 + 1000.0)  # each side's spring against it
    assert cup["0"].signals["plant.squeeze"][-1] == pytest.approx(squeeze, rel=1e-3)
    assert f"with {np.mean(cases['--case 2'].metrics['steady_contact_force']):.2f} N." in page(
        "explanation/method"
    )


@pytest.mark.slow
@pytest.mark.campaign
def test_adaptive_law(checkout):
    """And which ratios of reflectance the published law bears."""
    colours, _, laws = checked("explanation/adaptive_law", checkout)
    together = [ratio for ratio, run in colours.items() if run.metrics["time_difference"] < 0.1]
    assert together == [*colours][2:5] + [*colours][7:]
    learnt = laws["adaptive"].signals["controller.reflectance_ratio"][-1]
    assert learnt == pytest.approx(0.57, rel=0.01)


@pytest.mark.slow
@pytest.mark.campaign
def test_limits(checkout):
    """And what two of its formulas give, worked out here once more."""
    assert cli.main(["build", "docs/moving_object.py"]) == 0
    _, converter, _, friction, *_ = checked("explanation/limits", checkout)
    signals = converter["0.9"].signals
    free = ~signals["plant.contact[1]"].astype(bool) & (signals["plant.gap[1]"] < 0.02)
    slowest = np.argmax(np.where(free, signals["plant.velocity[1]"], -np.inf))
    blind = (0.0024 / 0.9) ** (1.0 / 1.1506) - 0.005
    assert signals["plant.gap[1]"][slowest] == pytest.approx(blind, abs=0.1e-3)
    assert friction["5"].signals["plant.gap[1]"][-1] == pytest.approx(5.0 / 98.0 - 0.035, abs=2e-4)


@pytest.mark.slow
def test_your_plant(checkout, capsys):
    assert cli.main(shlex.split(INDENTED.findall(page("how_to/python_block"))[0])[1:]) == 0
    source = (TEMPLATE_FOLDER / "spring_plant.py").read_text("utf-8")
    excerpts = 0
    for kind, block in BLOCKS.findall(page("how_to/python_block")):
        if kind == "python":
            assert block in source
            excerpts += 1
        elif kind == "console":
            try_commands(block, capsys)
        else:
            assert block.startswith("[signals]")
            (checkout / "bands.toml").write_text(block, encoding="utf-8")
    assert excerpts == 2
    (cases,) = checked("how_to/python_block", checkout)
    case_1 = cases["1"]
    k = int(np.flatnonzero(case_1.signals["plant.contact[2]"])[0])
    before = slice(k - 2, k)  # both free: how fast the gap closes is the impact, whoever moves
    rate = -np.diff(case_1.signals["plant.gap[2]"][before]) / np.diff(case_1.time[before])
    assert case_1.metrics["impact_velocity"][1] == pytest.approx(rate[0], rel=0.05)
    place = case_1.signals["plant.object_position"]
    assert place[k] < place[k - 1]  # finger 2 is the left one


@pytest.mark.slow
def test_an_fmu_from_elsewhere(checkout, grasp, capsys):
    """From the file of a vendor to QUALIFIED, by the page alone."""
    page_b = page("how_to/foreign_fmu")
    for kind, block in BLOCKS.findall(page_b):
        if kind == "console":
            try_commands(block, capsys)
        elif kind == "python":
            (checkout / "vendor.py").write_text(block, encoding="utf-8")
        else:
            fill_in(checkout / "my_system.toml", block)
    assert (checkout / "vendor/report.html").is_file()
    ours, theirs = simulate(grasp, step=1e-3).metrics, load_run(checkout / "vendor").metrics
    for name in ("time_to_contact", "impact_velocity", "steady_contact_force", "object_shift"):
        # of samples, and as our plant has them
        assert theirs[name] == pytest.approx(ours[name], rel=2e-3, abs=1e-12)


def try_commands(block, capsys):
    """Do the commands of a block, which print first what the page shows below them."""
    for command, shown in commands_of(block):
        if "CASE" in command:
            continue  # the rows of a table
        if not command.startswith("grasp-cosim "):
            subprocess.run(command, shell=True, check=True)
            continue
        capsys.readouterr()
        code = cli.main(shlex.split(command)[1:])
        assert capsys.readouterr().out.startswith(shown), command
        assert code == (1 if shown.startswith("NOT") else 0), command


def test_the_parameters_that_are_no_numbers_are_counted():
    """Those of the FMUs that come with the package, as your_tool.md tells."""
    fields = [f for block in blocks().values() for f in declared(block)]
    parameters = [f for f in fields if f.causality == "parameter"]
    booleans = sum(f.kind is bool for f in parameters)
    enumerations = sum(f.enumeration is not None for f in parameters)
    said = f"our parameters {booleans} are Booleans, .* and {enumerations} are enumerations"
    assert re.search(said, " ".join(page("how_to/your_tool").split()))
