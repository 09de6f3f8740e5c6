"""A system from Python: components of any kind, and the tables of a file as arguments."""

import re
import sys

import numpy as np
import pytest
from grasp_cosim import InputError, System, metric, simulate, sweep
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.inspection.block_templates import TEMPLATE_FOLDER
from grasp_cosim.ssp.to_archive import write_ssp
from grasp_cosim.sweeps.run import Task, packed, run_packed
from grasp_cosim.system.parts import Component, Connection, Port
from grasp_cosim.system.toml import toml_table

EXPERIMENT = {"step": 1e-3, "stop": 0.5}
SPRING = TEMPLATE_FOLDER / "spring_plant.py"


class Brake:
    """A force against the velocity of finger 1, and none on the other."""

    inputs = {"velocity": "m/s", "most": (2.0, "N")}  # noqa: RUF012
    outputs = ("force[1]", "force[2]")
    parameters = {"gain": (5.0, "N.s/m"), "push": (1.0, "N")}  # noqa: RUF012

    def step(self, t, inputs):
        force = -self.gain * inputs["velocity"] - self.push
        return {"force[1]": max(force, -inputs["most"]), "force[2]": 0.0}


CONNECTIONS = [
    "plant.velocity[1] -> brake.velocity",
    ("brake.force[1]", "plant.force[1]"),
    {"from": "brake.force[2]", "to": "plant.force[2]"},
]


def braked(grasp, brake=Brake, **more):
    components = {"plant": grasp.by_name["plant"], "brake": brake}
    more = {"connections": CONNECTIONS, "experiment": EXPERIMENT, **more}
    return System(components=components, **more)


def test_a_system_of_tables_is_that_of_the_file(grasp, fmus):
    tables = toml_table(SYSTEM, "system file")
    for entry in tables["components"].values():
        entry["fmu"] = fmus / entry["fmu"]
    made = System(SYSTEM.name, **tables)
    assert made == System.load(SYSTEM, fmus)
    plain = {name: entry["fmu"] for name, entry in tables["components"].items()}
    values = {f"{n}.{k}": v for n, e in tables["components"].items() for k, v in
              e.get("values", {}).items()}  # fmt: skip
    again = System(SYSTEM.name, **{**tables, "components": plain}).with_values(values)
    assert again == made


def test_connections_are_texts_pairs_tables_or_parts(grasp):
    parts = [*CONNECTIONS[:2], Connection(Port("brake", "force[2]"), Port("plant", "force[2]"))]
    assert braked(grasp, connections=parts).connections == braked(grasp).connections
    scaled = [*CONNECTIONS[:2], {"from": "brake.force[2]", "to": "plant.force[2]", "factor": 2.0}]
    assert braked(grasp, connections=scaled).connections[2].factor == 2.0


def test_a_braked_finger_comes_to_the_speed_of_its_force(grasp):
    """m v' = -gain v - push between points; the force of a point holds until the next one."""
    mass, step, v = 0.5, EXPERIMENT["step"], 0.0
    expected = [v]
    for _ in range(300):  # the object is farther away
        v += step / mass * (-5.0 * v - 1.0)
        expected.append(v)
    result = simulate(braked(grasp), stop=0.3)
    np.testing.assert_allclose(result["plant.velocity[1]"], expected, rtol=1e-9, atol=1e-12)
    assert result["plant.velocity[1]"][-1] == pytest.approx(-1.0 / 5.0, rel=0.06)
    assert result.units["brake.force[1]"] == "N"


def test_what_is_not_connected_keeps_its_start_value_and_parameters_can_be_set(grasp):
    system = braked(grasp).with_values({"brake.most": 0.5, "brake.gain": 0.0})
    assert simulate(system)["brake.force[1]"].tolist() == [-0.5] * 501
    rows = {"brake.push": [0.0, 1.0]}
    table = sweep(braked(grasp), rows, metrics=[first_force], native=True)
    assert table.columns["first_force"] == [0.0, -1.0]


def first_force(run):
    return run["brake.force[1]"][0]


def test_an_object_is_copied_for_each_run_and_its_attributes_are_its_parameters(grasp):
    strong = Brake()
    strong.push = 1.5
    system = braked(grasp, strong)
    assert system.parameters["brake.push"].value == 1.5
    assert simulate(system.with_values({"brake.push": 0.25}))["brake.force[1]"][0] == -0.25
    assert (strong.push, hash(system)) == (1.5, hash(braked(grasp, strong)))


def test_a_function_has_the_variables_that_connections_name(grasp):
    times = []

    def push(t, inputs):
        times.append(t)
        return -1.0 if inputs["contact"] else -2.0

    links = ["plant.contact[1] -> push.contact", "push.force -> plant.force[1]"]
    system = System(
        components={
            "plant": {"fmu": grasp.by_name["plant"], "values": {"force[2]": 0.0}},
            "push": {"fmu": push, "step": 2e-3},
        },
        connections=links,
        experiment={"step": 1e-3, "stop": 8e-3},
    )
    result = simulate(system)
    assert result["push.force"].tolist() == [-2.0] * 9
    assert result.units["push.force"] == "N"
    assert sorted({*times}) == pytest.approx([0.0, 2e-3, 4e-3, 6e-3, 8e-3])


def test_the_file_of_a_block_is_built(grasp):
    made = System(components={"plant": {"fmu": SPRING, "values": {"force[1]": 0, "force[2]": 0}}},
                  experiment=EXPERIMENT)  # fmt: skip
    again = System(components={"plant": {"fmu": str(SPRING), "values": {"force[1]": 0, "force[2]":
                   0}}}, experiment=EXPERIMENT)  # fmt: skip
    assert made == again
    assert made.components[0].fmu.name == "SpringPlant.fmu"
    assert isinstance(made.components[0], Component)


class Odd:
    inputs = {"u": "furlong"}  # noqa: RUF012
    outputs = ()

    def step(self, t, inputs):
        return {}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"brake": 5}, "components.brake = 5: must be the path of an FMU, the file of a block"),
        ({"brake": Odd}, "components.brake: inputs: 'u' = 'furlong': no unit that is known"),
        ({"experiment": {"step": 1e-3}}, "experiment.stop = None"),
        ({"connections": [*CONNECTIONS, ("a", "b")]}, r"connections\[3\]: from = 'a': must be"),
        ({"connections": CONNECTIONS[1:]}, "no source for brake.velocity"),
        ({"stop": 2.0}, "unknown entry 'stop'"),
        ({"brake": {"fmu": Brake, "isolation": "process"}}, "brake: is Python code of this"),
        ({"brake": "no.py"}, "components.brake: .*no.py"),
    ],
)
def test_what_is_no_system_is_said_in_a_line(grasp, more, said):
    if "velocity" in said:
        more = {**more, "brake": type("Bare", (Brake,), {"inputs": {"velocity": "m/s"}})}
    with pytest.raises(InputError, match=f"^system: .*{said}[^\n]*$") as raised:
        braked(grasp, **more)
    assert str(raised.value).isprintable()


def test_python_code_is_in_no_archive(grasp, tmp_path):
    said = re.escape(f"{tmp_path / 's.ssp'}: brake is Python code, Brake (Python)")
    with pytest.raises(InputError, match=f"^{said}; must be an FMU[^\n]*$"):
        write_ssp(braked(grasp), tmp_path / "s.ssp")
    assert not (tmp_path / "s.ssp").exists()


def test_the_parameters_of_a_system_have_units_and_ranges(grasp):
    found = braked(grasp).parameters
    assert found["plant.object_width"] == (0.07, "m", 0.0, 10.0, "W, width of the object")
    assert found["brake.gain"][:4] == (5.0, "N.s/m", None, None)
    assert "plant.force[1]" not in found
    with pytest.raises(KeyError, match=r"did you mean plant\.object_width\?"):
        found["plant.object_widht"]
    with pytest.raises(TypeError):
        found["plant.object_width"] = 1.0
    heads, *lines = repr(found).splitlines()
    assert heads.split() == ["parameter", "value", "unit", "range", "description"]
    assert lines[-2].split() == ["brake.gain", "5", "N.s/m"]
    assert "<td>0 to 10</td>" in found._repr_html_()
    assert found._ipython_key_completions_() == list(found)
    assert sys.getsizeof(repr(grasp.parameters)) < 4000


def test_a_run_elsewhere_takes_the_code_along(grasp):
    task = Task(braked(grasp), (metric("first")(first_force),))
    there = run_packed(packed(task, with_fmus=True), (0, {"brake.push": 0.5}))
    assert (there.metrics, there.error) == ({"first": -0.5}, None)


def test_code_that_cannot_go_to_another_process_is_refused_in_a_line(grasp, monkeypatch):
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    local = type("Local", (Brake,), {})
    with pytest.raises(InputError, match=r"^system: cannot go to another process: .*Local[^\n]*$"):
        packed(Task(braked(grasp, local)), with_fmus=False)


def test_other_attributes_and_other_code_are_other_runs(grasp):
    objects = [Brake(), Brake(), Brake()]
    objects[2].push = 0.5
    one, same, other = (braked(grasp, brake).by_name["brake"].content for brake in objects)
    assert one == same
    assert len({one, other, braked(grasp).by_name["brake"].content}) == 3
    assert b"-inputs" in one


REFUSED = [
    ({"components": {}}, r"components = \{\}: must be by name"),
    ({"components": ["x.fmu"]}, r"components = \['x.fmu'\]: must be by name"),
    ({"connections": None}, "connections = None: must be a list"),
    ({"connections": "plant.gap -> a.b"}, "connections = 'plant.gap -> a.b': must be a list"),
]


@pytest.mark.parametrize(("wrong", "said"), REFUSED)
def test_what_are_no_components_or_connections(grasp, wrong, said):
    given = {"components": {"plant": grasp.by_name["plant"]}, "experiment": EXPERIMENT}
    with pytest.raises(InputError, match=f"^system: {said}"):
        System(**{**given, **wrong})


def test_a_block_that_is_not_there_is_named():
    with pytest.raises(InputError, match=r"components.a: nothing.py: No such file or directory$"):
        System(components={"a": "nothing.py"}, experiment=EXPERIMENT)


DECLARED = [
    ({3: 1.0}, r"parameters: 3: must be a name, a text"),
    ({"velocity": 1.0}, r"parameters: 'velocity' is an input, too; must be one of them"),
]


@pytest.mark.parametrize(("parameters", "said"), DECLARED)
def test_a_name_is_a_text_and_of_one_variable(grasp, parameters, said):
    code = type("Code", (Brake,), {"parameters": parameters})
    with pytest.raises(InputError, match=rf"components.brake: {said}"):
        braked(grasp, code)


def test_scalars_of_numpy_are_start_values(grasp):
    parameters = {"gain": np.float64(5.0), "push": (np.float32(1.0), "N")}
    made = braked(grasp, type("Code", (Brake,), {"parameters": parameters}))
    assert (made.start("brake.gain"), made.start("brake.push")) == (5.0, 1.0)


@pytest.mark.parametrize("value", ["x", [1.0], np.zeros(2)])
def test_what_it_returns_are_numbers(grasp, value):
    def brake(t, inputs):
        return {"force[1]": value, "force[2]": 0.0}

    said = r"^brake: returned force\[1\] = .*; must be a number at t = 0 s"
    with pytest.raises(InputError, match=said):
        simulate(braked(grasp, brake))


@pytest.mark.parametrize("values", [None, [1.0], {3: 1.0}])
def test_values_are_by_place(grasp, values):
    with pytest.raises(InputError, match=r"^with_values .*: must be a (mapping of keys|key of)"):
        grasp.with_values(values)


def test_an_archive_goes_into_a_folder(grasp, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"cannot write to .*: Not a directory"):
        write_ssp(grasp, tmp_path / "file" / "system.ssp")
