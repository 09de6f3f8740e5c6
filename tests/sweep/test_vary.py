"""A study without a file is the one that a file with the same grid would be."""

from pathlib import Path

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.grasp.presets import with_preset
from grasp_cosim.sweep.distributions import Listed
from grasp_cosim.sweep.read import Made, read_studies
from grasp_cosim.sweep.study import Curve, Map, Pictures
from grasp_cosim.sweep.vary import parameter, varied

POSITION = "plant.initial_object_position=0:0.05:11"
REFLECTANCE = "sensor_1.reflectance=0.3,0.57,1.2"
FILE = """
case = 1
step = 1e-3
outputs = ["plant.gap[1]"]
[values]
"plant.object_width" = 0.06
[design]
kind = "grid"
[[parameters]]
variables = ["plant.initial_object_position"]
linspace = { from = 0.0, to = 0.05, count = 11 }
[[parameters]]
variables = ["sensor_1.reflectance"]
values = [0.3, 0.57, 1.2]
"""


def test_it_is_the_study_of_a_file_that_says_the_same(grasp: System, tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(FILE)
    (of_file,) = read_studies(path, Made(lambda _: grasp, with_preset))
    system = with_preset(grasp, "case_1").with_experiment(1e-3, None)
    system = system.with_values({"plant.object_width": "0.06"})
    made = varied(system, (POSITION, REFLECTANCE), ("plant.gap[1]",))
    assert made.identity == of_file.identity
    assert made.runs == 33
    assert [made.values(k) for k in range(33)] == [of_file.values(k) for k in range(33)]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=0:1:3", (0.0, 0.5, 1.0)),
        ("a.b=1e-3:-1e-3:2", (1e-3, -1e-3)),
        ("a.b=2", (2,)),
        ("a.b=0.3, 1", (0.3, 1)),
        ("a.b=true,false", (True, False)),
        ("a.b=fast,a:b", None),
        ("a.b=coarse,fine", ("coarse", "fine")),
        ("a.A[1,2]=1,2", (1, 2)),
    ],
)
def test_what_is_said_of_a_parameter(text: str, values: tuple[float, ...] | None) -> None:
    if values is None:
        with pytest.raises(InputError, match="2 numbers between colons; must be COMPONENT"):
            parameter(text)
        return
    found = parameter(text)
    name = text.partition("=")[0]
    assert (found.name, found.variables, found.ratio_to) == (name, (name,), None)
    assert found.distribution == Listed(values)
    assert [type(v) for v in found.distribution.extremes] == [type(v) for v in values]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("plant.x", "must be COMPONENT.VARIABLE=START:END:COUNT or =VALUE,VALUE,..."),
        ("plant=1", "must be COMPONENT.VARIABLE=START:END:COUNT"),
        ("=1", "must be COMPONENT.VARIABLE"),
        ("plant.x=", "an empty value; must be COMPONENT"),
        ("plant.x=1,,2", "an empty value"),
        ("plant.x=0:1", "2 numbers between colons"),
        ("plant.x=0:1:2:3", "4 numbers between colons"),
        ("plant.x=0:1:2.5", "count = 2.5: must be a whole number 2 to 100000"),
        ("plant.x=0:1:1", "count = 1: must be a whole number 2 to"),
        ("plant.x=0:b:3", "to = 'b': must be a finite number"),
        ("plant.x=0:inf:3", "to = inf: must be a finite number"),
        (f"plant.x=0:1{'0' * 5000}:3", "to = inf: must be a finite"),
    ],
)
def test_what_is_no_parameter_is_one_line(text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        parameter(text)
    said = str(caught.value)
    assert said.startswith(f"--vary {text!r}: ")
    assert message in said
    assert "\n" not in said


@pytest.mark.parametrize(
    ("texts", "of", "message"),
    [
        (("plnt.x=1",), (), "^--vary: plnt.x: .*no component 'plnt'"),
        (("plant.x=1",), (), "^--vary: plant.x: GripperPlant.fmu has no variable 'x'"),
        (
            ("plant.object_width=0.07,50",),
            (),
            "^--vary: plant.object_width: .* = 50: must be a fin",
        ),
        (("plant.object_width=nan",), (), "object_width = nan: must be a finite"),
        (("plant.object_width=wide",), (), "object_width = 'wide': must be a"),
        (
            (POSITION, POSITION),
            (),
            "parameter 'plant.initial_object_position' twice; must be there",
        ),
        (("plant.force[1]=1,2",), (), "two sources"),
        (
            ("sensor_1.reflectance=0.3:1.2:400", "sensor_2.reflectance=0.3:1.2:400"),
            (),
            "160000 runs",
        ),
        ((POSITION,), ("tilt",), "^--of: no metric or signal 'tilt'"),
        ((POSITION, REFLECTANCE, "plant.object_width=0.06,0.07"), (), "^--plot: 3 parameters vary"),
        (("plant.x=1",), ("plant.gap[1]",), "no variable 'x'"),
    ],
)
def test_what_does_not_fit_is_one_line(
    grasp: System, texts: tuple[str, ...], of: tuple[str, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        varied(grasp, texts, of, plot=True)
    assert "\n" not in str(caught.value)


def test_one_gives_curves_and_two_give_maps(grasp: System) -> None:
    """Of a metric with a value for each finger one curve has both, and there is a map for each."""
    x, y = (text.partition("=")[0] for text in (POSITION, REFLECTANCE))
    of = ("time_difference", "impact_velocity", "plant.gap[1]")
    one, two, primary, none = (
        varied(grasp, texts, asked, plot=plot)
        for texts, asked, plot in (
            ((POSITION,), of, True),
            ((POSITION, REFLECTANCE), of, True),
            ((POSITION,), (), True),
            ((POSITION,), of, False),
        )
    )
    assert one.pictures == Pictures(curves=tuple(Curve(x, name) for name in of))
    columns = ("time_difference", "impact_velocity[1]", "impact_velocity[2]", "plant.gap[1]")
    assert two.pictures == Pictures(tuple(Map(x, y, name) for name in columns))
    assert primary.pictures == Pictures(curves=(Curve(x, "time_to_contact"),))
    assert none.pictures == Pictures()
    assert [s.outputs for s in (one, primary, none)] == [("plant.gap[1]",), (), ("plant.gap[1]",)]
