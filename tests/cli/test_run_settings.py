"""run: single values of the system file by --set, FMUs by --swap; a mistake is one line."""

import json
import shlex

import pytest

SWAP = "--swap plant=fmus/GripperPlant.fmu"


@pytest.fixture(autouse=True)
def their_folder(fmus, tmp_path):
    (tmp_path / "fmus").symlink_to(fmus)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("--set plant.object_width", "--set 'plant.object_width': must be PLACE=VALUE"),
        (
            "--set scheme=jacobi",
            "--set scheme: no place in a system file; did you mean",
        ),
        ("--set experiment.step=0", "experiment.step = 0 s: must be a number greater than 0"),
        ("--set components.hand.step=1", "--set components.hand.step: no component 'hand'; valid"),
        (
            "--set components.plant.isolation=full",
            "--set components.plant.isolation = 'full': must be one of none, process",
        ),
        (
            "--step 1e-3 --set experiment.step=1e-4",
            "--set experiment.step: experiment.step is given by --step, too; must be given once",
        ),
        (
            f"{SWAP} --set components.plant.fmu=x.fmu",
            "--set components.plant.fmu: components.plant.fmu is given by --swap plant, too",
        ),
        (f"{SWAP} {SWAP}", "--swap plant: components.plant.fmu is given by --swap plant, too"),
        (
            "--set plant.object_width=0.06 --set components.plant.values.object_width=0.06",
            "--set components.plant.values.object_width: this place is given twice",
        ),
        (f"{SWAP} --set components.plant.rename.gap[1]=Gap", "no variable 'Gap'; did you mean gap"),
        (
            f"{SWAP} --set components.plant.units.gap[1]=quux",
            "units: 'gap[1]' = 'quux': no unit that GripperPlant.fmu defines",
        ),
        (
            "--swap plant=fmus/ProximitySensor.fmu",
            "--swap plant: ProximitySensor.fmu has no output 'gap[1]', and 7 more that are "
            "connected; valid: intensity; if they have other names: --set "
            "'components.plant.rename.gap[1]=NAME', or `grasp-cosim init my_system.toml --as plant",
        ),
        (
            "--controller adaptive --swap controller=x.fmu",
            "controller adaptive: cannot be used with another FMU for controller",
        ),
        (
            "--set input.interpolation=held",
            "--set input.interpolation: there is no input file; must have input.file, too",
        ),
        ("--input none.csv", "none.csv: no such input file"),
        ("--input a.csv --set input.file=b.csv", "input.file is given by --input, too"),
        ("--mdf", "--mdf: needs --out, the folder for signals.mf4"),
        ("--set realtime.cpu=0", "--set realtime.cpu=0: does nothing without --realtime"),
        ("--realtime --set realtime.factor=0", "--set realtime: factor = 0: must be a finite num"),
        (
            "--realtime --set realtime.priority=0",
            "--set realtime: priority = 0: must be a whole number from 1 to 99",
        ),
    ],
)
def test_a_mistake_is_one_line(command, line, said):
    code, out, err = command("run", *shlex.split(line))
    assert (code, out) == (2, "")
    assert err.startswith("grasp-cosim: ")
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_what_is_set_is_in_the_settings_of_the_run(command, tmp_path):
    """The gaps are taken for mm: the sensors see a thousandth of them."""
    line = (
        f"{SWAP} --set components.plant.units.gap[1]=mm --set components.plant.units.gap[2]=mm "
        "--set components.plant.isolation=process --set experiment.scheme=jacobi "
        "--set experiment.step=1e-3 --stop 0.002 --set components.sensor_1.step=2e-3 --out out"
    )
    code, _, err = command("run", *line.split())
    assert code == 0, err
    run = json.loads((tmp_path / "out/run.json").read_text("utf-8"))
    assert (run["scheme"], run["step"], run["stop"]) == ("jacobi", 1e-3, 2e-3)
    plant = run["components"]["plant"]
    assert (plant["isolation"], plant["units"]) == ("process", {"gap[1]": "mm", "gap[2]": "mm"})
    assert run["components"]["sensor_1"]["step"] == 2e-3
