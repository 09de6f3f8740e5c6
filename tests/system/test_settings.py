"""Settings, roles, presets, groups of metrics; what of a system is not as it was read."""

import json
from dataclasses import replace

import pytest
from grasp_cosim import InputError, System, grasp_system, load_run, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.ssp.to_archive import write_ssp
from grasp_cosim.system.settings import changed, settings

SPECIAL = """
[initialisation]
loops = "refuse"
tolerance = 1e-6
iterations = 9

[roles]
plant = "controller"

[realtime]
factor = 0.5

[[events]]
at = 0.5
set = { "sensor_1.reflectance" = 0.6 }

[[events]]
when = "plant.gap[1] < 0.01"
set = { "sensor_1.surface" = "brown", "sensor_2.reflectance" = 1 }

[[faults]]
connection = "sensor_1.intensity -> controller.intensity[1]"
kind = "noise"
standard_deviation = 0.002
from = 1.5
until = 2.0
when = "plant.contact[2] == true"
seed = 1

[[faults]]
connection = "controller.intensity[1]"
kind = "saturation"
high = 0.4
"""


def test_the_settings_of_the_grasp_and_of_one_that_says_all(grasp, fmus, tmp_path, snapshot):
    text = SYSTEM.read_text("utf-8") + SPECIAL
    gap = '"plant.gap[1] -> sensor_1.gap"'
    scaled = '{ from = "plant.gap[1]", to = "sensor_1.gap", factor = 2.0, offset = -0.5 }'
    assert gap in text
    own = '[components.plant]\nstep = 2e-4\nisolation = "process"\nunits = { "gap[2]" = "m" }\n'
    text = text.replace(gap, scaled).replace("[components.plant]\n", own)
    text = text.replace("stop = 3.0", 'stop = 3.0\nstart = 1.0\ndiverging = "continue"')
    (tmp_path / "special.toml").write_text(text, "utf-8")
    for system in (grasp, System.load(tmp_path / "special.toml", fmus)):
        assert json.loads(json.dumps(settings(system))) == snapshot


@pytest.fixture
def system(fmus):
    """The published grasp as it is."""
    return grasp_system()


@pytest.mark.parametrize(
    ("do", "found"),
    [
        (lambda s: s, {}),
        (lambda s: s.with_values({"plant.object_width": 0.06}), {"plant.object_width": 0.06}),
        (lambda s: s.with_values({"sensor_1.reflectance": 0.5}), {"sensor_1.reflectance": 0.5}),
        (lambda s: s.with_values({"sensor_1.reflectance": 1.0}), {}),  # as its FMU starts
        (lambda s: s.with_presets("case_2"), {}),
        (
            lambda s: s.with_presets("case_1"),
            {"controller.simultaneous_contact.enabled": False},
        ),
        (lambda s: s.with_presets("case_1").with_presets("case_2"), {}),
        (lambda s: s.with_experiment(1e-3, 3.0, "jacobi"), {"step": 1e-3, "scheme": "jacobi"}),
        (
            lambda s: s.swap("plant", s.components[0].fmu.with_name("GripperPlantMovable.fmu")),
            {"plant": "GripperPlantMovable.fmu"},
        ),
    ],
)
def test_what_differs_from_the_file_and_the_fmus(do, found, system):
    assert changed(do(system)) == found


def test_a_result_tells_it(system):
    values = {"plant.initial_object_position": 0.02}
    result = simulate(system.with_values(values), step=1e-3, stop=0.01)
    assert result.settings["changed"] == {**values, "step": 1e-3, "stop": 0.01}


SENSOR = """
[experiment]
step = 1e-3
stop = 0.02
[components.eye]
fmu = "{fmu}"
values = {{ gap = 0.02 }}
"""


@pytest.fixture
def load_with(fmus, tmp_path):
    """The system of one sensor, with more text at the end of its file."""

    def load(more):
        path = tmp_path / "eye.toml"
        path.write_text(SENSOR.format(fmu=fmus / "ProximitySensor.fmu") + more, "utf-8")
        return System.load(path)

    return load


PRESETS = """
[presets.dim]
"eye.reflectance" = 0.5
"eye.gain" = 0.001
[presets.bright]
"eye.reflectance" = 2.0
"eye.adc.enabled" = true
"""


def test_roles_are_those_of_the_file_and_in_the_settings(load_with):
    system = load_with('[roles]\nsensor_1 = "eye"\nlook = "eye"\n')
    assert system.roles == {"sensor_1": "eye", "look": "eye"}
    assert settings(system)["roles"] == {"sensor_1": "eye", "look": "eye"}
    assert load_with("").roles == {}


def test_a_preset_sets_its_values_and_a_later_one_goes_first(load_with):
    system = load_with(PRESETS)
    both = system.with_presets("dim", "bright")
    assert both.component("eye", "").values == {
        "gap": 0.02, "reflectance": 2.0, "gain": 0.001, "adc.enabled": True,
    }  # fmt: skip
    assert system.with_presets("bright", "dim").start("eye.reflectance") == 0.5
    assert system.with_presets() == system
    assert both.presets == system.presets


def test_a_preset_that_is_not_there_names_those_that_are(load_with):
    with pytest.raises(InputError) as caught:
        load_with(PRESETS).with_presets("dim", "dark")
    assert str(caught.value) == (
        "eye.toml: no preset 'dark'; valid: dim, bright; a system file has them as [presets.NAME]"
    )


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ('"ear.gain" = 1.0', r"\[presets.odd\] ear.gain: no component 'ear'; valid: eye, "),
        (
            '"eye.gane" = 1.0',
            r"\[presets.odd\] eye.gane: .* no input, parameter or initial value 'gane'",
        ),
        ('"eye.gain" = -1.0', r"\[presets.odd\] eye.gain.* = -1.0: must be "),
        ('"eye.adc.bits" = 1.5', r"\[presets.odd\] eye.adc.bits.* = 1.5: must be a whole number"),
        (
            '"eye.intensity" = 1.0',
            r"\[presets.odd\] eye.intensity: .* is an output that the FMU calculates",
        ),
    ],
)
def test_a_preset_is_checked_where_it_is_used(load_with, value, message):
    """A file may have presets that only another swap or build of an FMU takes."""
    system = load_with(f"{PRESETS}[presets.odd]\n{value}\n")
    assert system.with_presets("dim").start("eye.gain") == 0.001
    with pytest.raises(InputError, match=rf"^eye\.toml: {message}") as caught:
        system.with_presets("odd")
    assert "\n" not in str(caught.value)


def test_a_system_that_names_none_has_none(grasp):
    for system, some in ((grasp, True), (replace(grasp, metrics=()), False)):
        result = simulate(system, step=1e-3, stop=0.01)
        assert bool(result.measured.values) is some
        assert result.measured.missing == ()


def test_a_recorded_run_and_an_archive_keep_the_groups(grasp, tmp_path):
    result = simulate(grasp, step=1e-3, stop=0.2)
    result.to_csv(tmp_path / "signals.csv")
    result.to_json(tmp_path / "run.json")
    back = load_run(tmp_path)
    assert (back.groups, back.more_metrics) == (["grasp"], ())
    assert back.measured.metrics == result.measured.metrics
    write_ssp(grasp, tmp_path / "grasp.ssp")
    assert System.load(tmp_path / "grasp.ssp").metrics == ("grasp",)
