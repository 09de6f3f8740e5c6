"""Wrong command lines: exit code 2, one line on standard error, nothing else said or written."""

import shlex
import shutil

import pytest
from comparison.made import write_fmu

ROWS = """
run missing.toml :: missing.toml: no such system file
run --step -1e-3 :: step = -0.001 s: must be a number greater than 0
run --step 7e-4 :: does not divide stop = 3 s; stop could be 3.0002 s
run --stop 1e9 :: do not fit into memory; must have a longer step
run --case 3 :: 3 is not in the range 0<=x<=2
run --scheme euler :: 'euler' is not one of 'sequential', 'jacobi'
run --set plant.object_width :: --set 'plant.object_width': must be KEY=VALUE
run --set plant.object_width=0.5 :: object_width = 0.5 m
run --set plant.finger_mass[1]=-0.5 :: '-0.5': must be a finite number from 0.001 to 1000 kg
run --set plant.mass=1 :: no input, parameter or initial value 'mass'; did you mean finger_mass[1]
run --set sensor_1.gap=0.01 :: sensor_1.gap has two sources, the connection and a value
run --set scheme=jacobi :: --set scheme: no key of a system file; did you mean
run --set components.plant.isolation=full :: isolation = 'full': must be one of none, process
run --step 1e-3 --set experiment.step=1e-4 :: experiment.step is given by --step, too; must be
run --swap plant=x --set components.plant.fmu=y :: components.plant.fmu is given by --swap plant
run --set plant.a=1 --set components.plant.values.a=1 :: values.a: this key is set twice
run --set components.plant.rename.gap[1]=Gap :: no variable 'Gap'; did you mean gap
run --set components.plant.units.gap[1]=quux :: 'gap[1]' = 'quux': no unit that GripperPlant.fmu
run --swap plant=missing.fmu :: missing.fmu: no such FMU file
run --swap plant=sensor.fmu :: 'components.plant.rename.gap[1]=NAME', or `grasp-cosim init my_system
run --controller adaptive --swap controller=x.fmu :: cannot be used with another FMU for controller
run --set input.interpolation=held :: input.file = None: must be the path of a CSV file
run --input none.csv :: none.csv: No such file or directory
run --input a.csv --set input.file=b.csv :: input.file is given by --input, too
run --mdf :: --mdf: needs --out, the folder for signals.mf4
run --format arrow :: --format arrow: needs --out, the folder for signals.arrow
run --set realtime.cpu=0 :: --set realtime.cpu=0: does nothing without --realtime
run --realtime --set realtime.factor=0 :: --set realtime: factor = 0: must be a finite num
run --out file :: file: cannot write to
build --out file/below :: file/below: cannot write to
evaluate --out /proc/nowhere :: /proc/nowhere: cannot write to
build --native Gripper :: build: Gripper: no such block; must be of GraspController,
build --native --target linux65 :: build: --target 'linux65': must be of linux64,
build --native --fmi 1 :: Invalid value for '--fmi': '1' is not one of '2', '3'.
build --target linux64 :: --target linux64: needs --native
build --native --c-only c --fmi 3 :: build: --c-only cannot be used with --target
build --native --a2l :: --a2l: needs --native --c-only DIR
build file.toml :: file.toml: is a .toml file; must be a block, a Python file; `grasp-cosim
build plant.fmu :: plant.fmu: is an FMU; must be a block, a Python file; `grasp-cosim inspect
build GripperPlant :: GripperPlant is a built-in block: --native builds it on its own
build --fingers 3 block.py :: build: --fingers 3 cannot be used with block.py
inspect folder.toml :: folder.toml: is a folder; must be an FMU, a file
init file.toml :: file.toml: is there already; give another name, or --force
init a.ssp :: a.ssp: must end in .toml, a system file
init a.py :: a block in Python has --template plant, --template sensor, --template controller
init my-plant.py --template plant :: my-plant.py: must be NAME.py, NAME of letters, digits and _
init class.py --template plant :: class.py: is a name of Python's own; must be another, like my_cl
init math.py --template plant :: math.py: is a name of Python's own; must be another, like my_m
init gripper_plant.py --template plant :: GripperPlant.fmu is one of the FMUs that come with th
init a.py --template plant --tandem :: --tandem cannot be used with --template, which is no system
init folder.toml :: folder.toml: is a folder; must be the name of a file
init a.toml --as hand=vendor.fmu :: --as hand: no component 'hand'; valid: plant, sens
init a.toml --as plant=none.fmu :: none.fmu: no such FMU file
init a.toml --fmu a=vendor.fmu --fmu a=vendor.fmu :: must be a new name of
init a.toml --fmu a=vendor.fmu --as plant=vendor.fmu :: --as puts one into the grasp
init a.toml --fingers 3 --as plant=vendor.fmu :: `grasp-cosim run a.toml --swap plant=vendor.fmu`
init a.toml --fmu a=vendor.fmu --tandem :: each makes another system; must be one of them
init a.toml --angles 0,x :: --angles '0,x': must be numbers in degrees, as 0,90,225
identify a.csv :: a.csv: no such log; must be a .csv, .tsv, .mf4, .arrow, .feather, .parquet file
identify --fit inner[3] :: 'inner[3]' cannot be fitted; did you mean
identify --cross-validate --fit sensor :: a cross-validation leaves rows of contact times out
identify --fit mass :: the published experiments: 'mass' cannot be fitted; valid: coulomb
identify --set plant.nothing=1 :: --set plant.nothing:
identify --out /proc/nowhere :: /proc/nowhere: cannot write
qualify plant.fmu :: Missing option '--as'
qualify none.fmu --as plant :: none.fmu: no such FMU file
qualify plant.fmu --as hand :: --as hand: no component 'hand'; valid: plant, se
qualify plant.fmu --as plant --set components.plant.rename.a=b :: 'a' = 'b': plant.fmu has
qualify plant.fmu --as plant --bands no.toml :: no.toml: no such file of bands
sweep :: needs --vary or --table, one of them
sweep --vary plant.object_width :: --vary 'plant.object_width': must be KEY=START:END
sweep --vary plant.a=1,2 --scheduler tcp://x --workers 1 :: --workers: cannot be used with
sweep --vary plant.a=1,2 --out t.xlsx :: t.xlsx: must end in .csv or .parquet
sweep --table none.csv :: --table none.csv:
sweep --vary plant.a=1,2 --vary plant.a=1,2 :: plant.a: is given twice
sweep --vary plant.a=1,2 --set plant.a=0.05 :: plant.a: is given twice
compare nothing nothing :: nothing: no such run; must be a folder
compare nothing nothing -o folder.toml :: folder.toml: is a folder; must be the name of a file
proxy plant.fmu :: proxy: needs -o FILE.fmu or --c-header FILE, or both
proxy plant.fmu -o a --c-header a :: --c-header a: is the proxy; must be another file
proxy plant.fmu --c-header a --fmi 3 :: --fmi needs -o FILE.fmu
relay 0 5501 --delay 2:1 :: --delay '2:1': must be S or FROM:TO, in s, the longer last
serve plant.fmu --failsafe force :: --failsafe 'force': must be INPUT=VALUE
"""
"""A command line, and what is said of it."""


@pytest.fixture
def there(command, fmus, tmp_path):
    """A folder with an FMU of ours and one of a vendor, a file, a folder, a system file."""
    for name, fmu in (("plant", "GripperPlant"), ("sensor", "ProximitySensor")):
        shutil.copy(fmus / f"{fmu}.fmu", tmp_path / f"{name}.fmu")
    (tmp_path / "fmus").symlink_to(fmus)
    write_fmu(tmp_path / "vendor.fmu")
    (tmp_path / "file").touch()
    (tmp_path / "file.toml").write_text("mine")
    (tmp_path / "folder.toml").mkdir()
    return command


@pytest.mark.parametrize("row", ROWS.strip().splitlines())
def test_what_is_wrong_is_one_line(row, there, monkeypatch, tmp_path):
    line, said = row.split(" :: ")
    monkeypatch.setattr("grasp_cosim.grasp.system.built", lambda folder, *_: folder / "fmus")
    before = {path: path.stat().st_size for path in tmp_path.iterdir()}
    code, out, err = there(*shlex.split(line))
    assert (code, out) == (2, ""), err
    assert err.startswith("grasp-cosim: ")
    assert said in err
    assert err.count("\n") == 1
    assert {path: path.stat().st_size for path in tmp_path.iterdir()} == before
