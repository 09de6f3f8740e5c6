"""run --swap: what the new FMU calls things, in which units and where it runs."""

from pathlib import Path

import pytest
from conftest import Run
from grasp_cosim import InputError, System
from grasp_cosim.cli.options import isolations, replacements

PLANT, SENSOR = Path("vendor.fmu"), Path("sensor.fmu")


def test_of_one_component_its_name_may_be_left_out() -> None:
    given = {
        "renames": ("gap[1]=Gaps[1]", "plant.friction.coulomb[1]=F"),
        "named": ("gap[1]=mm",),
    }
    (new,) = replacements(given, {"plant": PLANT}).values()
    assert new.fmu == PLANT
    assert new.rename == {"gap[1]": "Gaps[1]", "friction.coulomb[1]": "F"}
    assert new.units == {"gap[1]": "mm"}


def test_of_several_it_goes_before() -> None:
    given = {"renames": ("plant.gap[1]=G", "sensor_1.gap=d"), "named": ("sensor_1.gap=mm",)}
    plant, sensor = replacements(given, {"plant": PLANT, "sensor_1": SENSOR}).values()
    assert (plant.rename, plant.units) == ({"gap[1]": "G"}, {})
    assert (sensor.rename, sensor.units) == ({"gap": "d"}, {"gap": "mm"})


def test_processes_of_all_components_or_of_one(grasp: System) -> None:
    def where(*texts: str) -> list[str]:
        return [c.isolation for c in isolations(grasp, texts).components]

    assert where() == ["none"] * 4
    assert where("process") == ["process"] * 4
    assert where("plant=process") == ["process", "none", "none", "none"]
    assert where("process", "sensor_1=none") == ["process", "none", "process", "process"]
    for text in ("full", "plant=full", "=process"):
        with pytest.raises(InputError, match=f"^--isolation '{text}': must be none, process, or"):
            where(text)


TWO = ("--swap", "plant=fmus/GripperPlant.fmu", "--swap", "sensor_1=fmus/ProximitySensor.fmu")
WRONG = [
    (("--rename", "a=b"), "--rename 'a=b': must come with --swap COMPONENT=FMU"),
    ((*TWO, "--rename", "a=b"), "several components are swapped; must begin with one of plant., s"),
    ((*TWO, "--units", "sensor_2.gap=mm"), "must begin with one of plant., sensor_1."),
    ((*TWO[:2], "--rename", "gap"), "must be [COMPONENT.]VARIABLE=FMUS_VARIABLE"),
    (
        (*TWO[:2], "--rename", "gap[1]=Gap"),
        "has no variable 'Gap'; did you mean gap[1], g",
    ),
    ((*TWO[:2], "--units", "gap[1]=quux"), "units: 'gap[1]' = 'quux': no unit that GripperPlant"),
    (
        ("--swap", "plant=fmus/ProximitySensor.fmu"),
        "--swap plant: ProximitySensor.fmu has no output 'gap[1]', and 7 more that are connected; "
        "valid: intensity; if they have other names: --rename 'gap[1]=NAME', or `grasp-cosim init "
        "my_system.toml --as plant=",
    ),
    (("--isolation", "hand=none"), "--isolation hand=none: no component 'hand'; valid: plant, s"),
]


@pytest.mark.parametrize(("arguments", "message"), WRONG)
def test_wrong_input_is_one_line(
    command: Run, fmus: Path, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    (tmp_path / "fmus").symlink_to(fmus)
    code, out, err = command("run", *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_a_unit_that_is_named_on_the_command_line(command: Run, fmus: Path, tmp_path: Path) -> None:
    """The gaps are taken for mm: the sensors see a thousandth of them."""
    (tmp_path / "fmus").symlink_to(fmus)
    units = ("--units", "gap[1]=mm", "--units", "plant.gap[2]=mm")
    short = ("--step", "1e-3", "--stop", "0.002", "--out", "out")
    assert command("run", *TWO[:2], *units, *short, "--isolation", "plant=process")[0] == 0
    settings = (tmp_path / "out/run.json").read_text("utf-8")
    assert '"isolation": "process"' in settings
    assert '"gap[1]": "mm"' in settings
