"""A study: what its runs set, and that it is the same for the same."""

from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.grasp.metrics import METRICS
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.distributions import Listed, Uniform
from grasp_cosim.sweep.run import Job, Task, run_job
from grasp_cosim.sweep.study import Map, Parameter, Pictures, Study

RATIO = Parameter("ratio", ("sensor_1.reflectance",), Uniform(0.5, 2.0), "sensor_2.reflectance")
LEFT = Parameter("left", ("sensor_2.reflectance",), Uniform(0.5, 1.0))
MASS = Parameter("mass", ("plant.finger_mass[1]", "plant.finger_mass[2]"), Uniform(0.4, 0.6))
SEEDS = ("sensor_1.noise.seed", "sensor_2.noise.seed")
RANDOM = Design("random", 50, 4)


@pytest.fixture
def study(grasp: System) -> Study:
    return Study("made", grasp, (RATIO, LEFT, MASS), RANDOM, SEEDS)


def test_one_number_drives_several_variables_and_a_ratio_its_reference(study: Study) -> None:
    for k in range(study.runs):
        point, values = study.point(k), study.values(k)
        assert values["plant.finger_mass[1]"] == values["plant.finger_mass[2]"] == point["mass"]
        ratio, left = point["ratio"], point["left"]
        assert isinstance(ratio, float)
        assert isinstance(left, float)
        assert values["sensor_2.reflectance"] == left
        assert values["sensor_1.reflectance"] == ratio * left


def test_a_ratio_to_what_does_not_vary_takes_the_system_s_value(grasp: System) -> None:
    study = Study("made", grasp.with_values({"sensor_2.reflectance": 0.5}), (RATIO,), RANDOM)
    assert study.values(3)["sensor_1.reflectance"] == 0.5 * float(study.point(3)["ratio"])


def test_no_two_seeds_are_alike(study: Study) -> None:
    found = [study.values(k)[name] for k in range(study.runs) for name in SEEDS]
    assert len(set(found)) == 2 * study.runs
    assert all(isinstance(s, int) and 0 <= s <= 10**9 for s in found)
    other = replace(study, design=replace(RANDOM, seed=5))
    assert other.values(0)[SEEDS[0]] != study.values(0)[SEEDS[0]]


def test_a_run_is_a_pure_function_of_its_index(study: Study) -> None:
    again = Study("again", study.system, study.parameters, RANDOM, SEEDS)
    backwards = [again.values(k) for k in reversed(range(study.runs))]
    assert [study.values(k) for k in range(study.runs)] == backwards[::-1]


def test_the_identity_is_that_of_all_that_decides(study: Study, tmp_path: Path) -> None:
    same = replace(
        study, name="other", pictures=Pictures((Map("ratio", "left", "time_difference"),))
    )
    assert same.identity == study.identity
    for other in (
        replace(study, design=replace(RANDOM, seed=5)),
        replace(study, design=replace(RANDOM, runs=51)),
        replace(study, parameters=(RATIO, LEFT)),
        replace(study, outputs=("plant.gap[1]",)),
        replace(study, system=study.system.with_experiment(step=1e-3)),
        replace(study, system=study.system.with_values({"plant.object_width": 0.06})),
        replace(study, parameters=(RATIO, replace(LEFT, distribution=Uniform(0.5, 0.9)), MASS)),
    ):
        assert other.identity["study"] != study.identity["study"]
        assert other.identity["fmus"] == study.identity["fmus"]
    fmu = tmp_path / "GripperPlant.fmu"
    fmu.write_bytes(study.system.component("plant", "").fmu.read_bytes() + b" ")
    changed = replace(study, system=study.system.swap("plant", fmu))
    assert changed.identity["study"] == study.identity["study"]
    assert changed.identity["fmus"] != study.identity["fmus"]


def parameter(variable: str, *values: float | bool | str, **more: str) -> Parameter:
    return Parameter("p", (variable,), Listed(values), **more)


WRONG = [
    ((), {}, r"no \[\[parameters\]\]"),
    ((MASS, MASS), {}, "parameter 'mass' twice"),
    ((MASS, parameter("plant.finger_mass[1]", 0.5)), {}, r"'plant.finger_mass\[1\]' twice"),
    ((replace(MASS, name="index"),), {}, "parameter 'index': is the name of a result"),
    ((parameter("plnt.x", 0.5),), {}, "no component 'plnt'; did you mean plant"),
    ((parameter("plant.x", 0.5),), {}, "has no variable 'x'"),
    ((parameter("plant.gap[1]", 0.5),), {}, r"no input or parameter 'gap\[1\]'"),
    ((parameter("plant.object_width", 0.07, 50.0),), {}, "object_width = 50.0: must be a finite"),
    ((parameter("sensor_1.gap", 0.5),), {}, "sensor_1.gap has two sources"),
    ((parameter("sensor_1.noise.seed", 0.5),), {}, "noise.seed = 0.5: must be a whole number"),
    ((replace(RATIO, distribution=Listed(("a",))),), {}, "'a': must be a number"),
    ((replace(LEFT, variables=("sensor_1.adc.bits",)),), {}, "type Integer; must have values"),
    ((parameter("sensor_1.gain", 1.0, ratio_to=RATIO.variables[0]), RATIO), {}, "a ratio itself"),
    ((parameter("sensor_1.gain", 1.0, ratio_to="sensor_1.gone"),), {}, "sensor_1.gone"),
    ((MASS,), {"outputs": ("plant.force[1]",)}, r"no output 'plant.force\[1\]'"),
    ((MASS,), {"seeds": ("sensor_1.seed",)}, "has no variable 'seed'"),
    ((MASS,), {"seeds": ("plant.finger_mass[1]",)}, r"variable 'plant.finger_mass\[1\]' twice"),
    ((MASS,), {"pictures": Pictures((Map("mass", "x", "y"),))}, "'x' with numbers; valid: mass"),
    ((replace(MASS, name="peak_contact_force[1]"),), {}, "is the name of a result or seed; must"),
    ((replace(MASS, name=SEEDS[0]),), {"seeds": SEEDS}, "noise.seed': is the name of a result or"),
    ((replace(MASS, name="proxies.plant.lost"),), {}, "is the name of a result"),
    ((MASS,), {"seeds": ("plant.object_width",)}, "object_width is of type Real; must be an Int"),
    ((MASS,), {"pictures": Pictures((), ("time",))}, "no column 'time' .*; did you mean time_"),
    ((parameter("sensor_1.gain", 1.0, ratio_to="sensor_1.noise.enabled"),), {}, "of type Boolean"),
    ((parameter("sensor_1.gain", 10**400, ratio_to="sensor_2.gain"),), {}, "must be a number, and"),
    ((parameter("sensor_1.gain", 1.0, ratio_to="plant.gap[1]"),), {}, "p: ratio_to: plant.gap"),
    ((RATIO, replace(LEFT, distribution=Uniform(0.5, 9.0))), {}, "reflectance = 18.0: must be a f"),
]  # fmt: skip


@pytest.mark.parametrize(("parameters", "more", "message"), WRONG)
def test_what_is_no_study(
    grasp: System, parameters: tuple[Parameter, ...], more: dict[str, tuple[str]], message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        Study("made", grasp, parameters, RANDOM, **more)  # type: ignore[arg-type]
    assert len(str(caught.value).splitlines()) == 1


def test_seeds_must_fit(grasp: System) -> None:
    with pytest.raises(InputError, match=r"seeds: 50 of them, from 1 to 32; must be fewer runs"):
        Study("made", grasp, (MASS,), RANDOM, ("sensor_1.adc.bits",))


@pytest.mark.parametrize("plant", ["GripperPlant", "GripperPlantCompliant", "GripperPlantMovable"])
def test_the_expected_columns_are_those_that_a_run_leaves(
    grasp: System, fmus: Path, plant: str
) -> None:
    system = grasp.swap("plant", fmus / f"{plant}.fmu").with_experiment(step=1e-3, stop=0.01)
    study = Study("made", system, (MASS,), RANDOM)
    found = run_job(Task(system, ()), Job(0, {})).metrics
    assert list(found) == [column for m in study.expected for column in m.columns]
    every = [column for m in METRICS for column in m.columns]
    assert [column for column in every if column in found] == list(found)
    assert all(study.metric_of(column) for column in found)


def test_a_picture_of_what_the_plant_does_not_tell(grasp: System) -> None:
    with pytest.raises(InputError, match="figures: no column 'squeeze' in the results; valid: "):
        Study("made", grasp, (MASS,), RANDOM, pictures=Pictures(distributions=("squeeze",)))
