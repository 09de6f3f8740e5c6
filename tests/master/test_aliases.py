"""Aliases of FMI 3.0: other names of variables, by which these are connected, set and driven."""

import re

import numpy as np
import pytest
from grasp_cosim import InputError, System, simulate
from grasp_cosim.interface.read import read_interface
from ssp.hand_made import (
    archive,
    bind,
    component,
    connect,
    entries_of,
    parameter_set,
    structure,
    system,
    zipped,
)
from support.compiled import pack
from support.native_fmus import MODELS, description, library_of, needs_gcc, state_space

pytestmark = needs_gcc
STEP, STOP = 0.1, 0.5


def with_aliases(xml, aliases):
    """A description in which each variable has another name, too."""
    for name, alias in aliases.items():
        element = re.search(rf'<(\w+) name="{name}"[^>]*>', xml)
        inner = f'<Alias name="{alias}" displayUnit="mm"/>'
        text = element[0]
        closed = f"{text[:-2].rstrip()}>{inner}</{element[1]}>"
        xml = xml.replace(text, closed if text.endswith("/>") else f"{text}{inner}")
    return xml


def dahlquist(folder, name="plant", **aliases):
    """der(x) = -k·x + u by Euler's method, y = x + d·u; further names by those that it has."""
    xml = description("dahlquist", "3.0", MODELS["dahlquist"], ["CoSimulation"])
    library = library_of("dahlquist", "3.0", True)
    return pack(folder / f"{name}.fmu", "3.0", "dahlquist", with_aliases(xml, aliases), library)


def load(folder, connections="", tables="", values="k = 1.0"):
    """A source, whose y is 1 all the time where nothing else is said, and a plant."""
    dahlquist(folder, "source")
    dahlquist(folder, "plant", u="drive", k="rate", y="height")
    path = folder / "aliases.toml"
    path.write_text(
        f"connections = [{connections}]\n[experiment]\nstep = {STEP}\nstop = {STOP}\n"
        '[components.source]\nfmu = "source.fmu"\nvalues = { u = 0.0, k = 0.0 }\n'
        f'[components.plant]\nfmu = "plant.fmu"\nvalues = {{ {values} }}\n{tables}',
        "utf-8",
    )
    return System.load(path)


def same(one, other):
    return np.array_equal(one["plant.y"], other["plant.y"])


def test_an_alias_of_an_input_is_connected(tmp_path):
    by_name = simulate(load(tmp_path, '"source.y -> plant.u"', values="k = 0.5"))
    by_alias = simulate(load(tmp_path, '"source.y -> plant.drive"', values="k = 0.5"))
    assert by_name["plant.y"][-1] != by_name["plant.y"][0]
    assert same(by_name, by_alias)
    assert np.array_equal(by_alias["plant.height"], by_alias["plant.y"])


def test_an_alias_of_a_parameter_is_set(tmp_path):
    by_name = simulate(load(tmp_path, values="k = 0.5, u = 1.0"))
    by_alias = simulate(load(tmp_path, values="rate = 0.5, drive = 1.0"))
    assert same(by_name, by_alias)
    changed = load(tmp_path, values="k = 2.0, u = 1.0").with_values({"plant.rate": 0.5})
    assert same(by_name, simulate(changed))
    assert changed.component("plant", "").values == {"k": 0.5, "u": 1.0}


TWICE = [
    ('"source.y -> plant.drive", "source.x -> plant.u"', "", "k = 1.0", "two sources"),
    ('"source.y -> plant.drive"', "", "u = 1.0", "two sources, the connection and a value"),
    (
        "",
        "",
        "u = 1.0, drive = 2.0",
        "drive = 2.0: is another name of u, which is 1.0; must have one",
    ),
    (
        '"source.y -> plant.u"',
        "[[events]]\nat = 0.2\nset = { 'plant.drive' = 1.0 }\n",
        "k = 1.0",
        "is an input with a connection: a fault on 'source.y -> plant.u' of kind",
    ),
    (
        "",
        "[[events]]\nat = 0.2\nset = { 'plant.drive' = 1.0, 'plant.u' = 1.0 }\n",
        "u = 1.0",
        "plant.drive and plant.u are names of one variable",
    ),
]


@pytest.mark.parametrize(("connections", "tables", "values", "message"), TWICE)
def test_two_names_are_one_source(tmp_path, connections, tables, values, message):
    with pytest.raises(InputError, match=message):
        load(tmp_path, connections, tables, values)


def test_two_names_may_say_the_same(tmp_path):
    assert load(tmp_path, values="u = 1.0, drive = 1.0").start("plant.u") == 1.0


def test_faults_events_and_columns_by_an_alias(tmp_path):
    fault = "[[faults]]\nconnection = 'plant.NAME'\nkind = 'stuck'\nvalue = 3.0\nfrom = 0.2\n"
    event = "[[events]]\nat = 0.3\nset = { 'plant.RATE' = 0.1 }\n"
    runs = [
        simulate(
            load(
                tmp_path,
                f'"source.y -> plant.{name}"',
                (fault + event).replace("NAME", name).replace("RATE", rate),
            )
        )
        for name, rate in (("u", "k"), ("drive", "rate"))
    ]
    assert same(*runs)
    (tmp_path / "in.csv").write_text("time,plant.drive\n0,0\n1,1\n", "utf-8")
    driven = simulate(load(tmp_path, "", '[input]\nfile = "in.csv"\n'))
    assert driven["plant.y"][-1] != 1.0
    with simulate.session(load(tmp_path, values="u = 0.0")) as session:
        session.set("plant.drive", 1.0)
        assert session.step(5)
        assert session["plant.y"] > 0.6


def test_an_alias_is_of_the_unit_of_its_variable(tmp_path):
    """A display unit is for people: values are in the unit."""
    interface = read_interface(dahlquist(tmp_path, u="drive"))
    alias = interface.by_name["drive"]
    assert (alias.unit, alias.display_unit) == (interface.by_name["u"].unit, "mm")


def test_arrays_by_an_alias(tmp_path):
    path = state_space(tmp_path)
    files = entries_of(path)
    xml = with_aliases(files["modelDescription.xml"].decode(), {"A": "system", "u": "in"})
    zipped(path, {**files, "modelDescription.xml": xml})
    ends = []
    for names in ("A u", "system in"):
        matrix, force = names.split()
        (tmp_path / "s.toml").write_text(
            '[experiment]\nstep = 0.1\nstop = 0.5\n[components.ss]\nfmu = "ss.fmu"\n'
            f'values = {{ {matrix} = [[-1,0,0],[0,-2,0],[0,0,-3]], "{force}[2]" = 4.0 }}\n',
            "utf-8",
        )
        ends.append(simulate(System.load(tmp_path / "s.toml"))["ss.y[2]"])
    assert np.array_equal(*ends)
    assert ends[0][-1] > 0.0


def test_an_archive_connects_and_sets_aliases(tmp_path):
    fmus = {
        f"resources/{name}.fmu": dahlquist(tmp_path, name, u="drive", k="rate").read_bytes()
        for name in ("source", "plant")
    }
    parts = component("source", "output y Real", bind(parameter_set("rate Real 0.0")))
    parts += component("plant", "input drive Real", bind(parameter_set("rate Real 0.5")))
    top = system("top", parts, connect("source/y", "plant/drive"))
    loaded = System.load(archive(tmp_path, structure(top), {}, fmus), step=STEP, stop=STOP)
    assert loaded.component("plant", "").values == {"k": 0.5}
    by_name = load(tmp_path, '"source.y -> plant.u"', values="k = 0.5")
    assert same(simulate(loaded), simulate(by_name))
