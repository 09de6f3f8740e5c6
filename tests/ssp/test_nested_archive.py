"""Components that are archives or structures themselves: as if their top system stood there."""

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.system.parts import Connection, Port
from ssp.hand_made import (
    archive,
    bind,
    component,
    connect,
    fmu,
    linear,
    parameter_set,
    structure,
    system,
)

GIVES, TAKES = fmu("output Real y - m"), fmu("input Real u 0.5 m", "parameter Real k 1.0 m")
PACKAGE, DEFINITION = "application/x-ssp-package", "application/x-ssp-definition"


def inner(unit="", bindings=""):
    """An SSD with an input and what takes it, twice as much."""
    connectors = f"input in Real {unit}" if unit else "input in"
    connections = connect("in", "b/u", linear(2.0))
    top = system("inside", component("b", "input u"), connections, connectors, bindings)
    return structure(top, '<ssd:DefaultExperiment startTime="5" stopTime="9"/>')


def packed(folder, ssd):
    (folder / "inner").mkdir()
    other = ssd.replace("inside", "other")
    return archive(folder / "inner", ssd, {"b": TAKES}, {"Other.ssd": other}).read_bytes()


def load(folder, sub, files, bindings="", unit=""):
    kind = PACKAGE if ".ssp" in sub else DEFINITION
    given = component("sub", f"input in Real {unit}", bindings, source=sub, type=kind)
    top = system("top", component("a", "output y Real") + given, connect("a/y", "sub/in"))
    return System.load(archive(folder, structure(top), {"a": GIVES}, files))


def test_an_archive_in_an_archive(tmp_path):
    loaded = load(tmp_path, "resources/sub.ssp", {"resources/sub.ssp": packed(tmp_path, inner())})
    assert [c.name for c in loaded.components] == ["a", "sub_b"]
    assert loaded.connections == (Connection(Port("a", "y"), Port("sub_b", "u"), 2.0, 0.0),)
    assert loaded.stop_ns == 1_000_000_000  # the experiment of what is nested has no meaning


def test_a_variant_of_it(tmp_path):
    files = {"resources/sub.ssp": packed(tmp_path, inner())}
    assert load(tmp_path, "resources/sub.ssp#Other.ssd", files).components[1].name == "sub_b"
    with pytest.raises(
        InputError, match=r"source 'None.ssd': not in the archive; did you mean Oth"
    ):
        load(tmp_path, "resources/sub.ssp#None.ssd", files)


def test_a_structure_of_the_same_archive_has_sources_relative_to_it(tmp_path):
    text = inner().replace('source="resources/b.fmu"', 'source="../a.fmu"')
    top = component("a", "output y Real") + component("sub", type=DEFINITION, source="x/sub.ssd")
    files = {"x/sub.ssd": text.replace("../a.fmu", "../resources/b.fmu")}
    loaded = System.load(
        archive(tmp_path, structure(system("top", top)), {"a": GIVES, "b": TAKES}, files)
    )
    assert [c.name for c in loaded.components] == ["a", "sub_b"]


def test_its_own_bindings_are_beaten_by_those_of_the_component_then_of_the_system(tmp_path):
    files = {}
    own = bind(parameter_set("b.k Real 1; b.u Real 2"))
    files["resources/sub.ssp"] = packed(tmp_path, inner(bindings=own))
    given = bind(parameter_set("b.k Real 3 mm"))
    assert load(tmp_path, "resources/sub.ssp", files).components[1].values["k"] == 1.0
    assert load(tmp_path, "resources/sub.ssp", files, given).components[1].values["k"] == 0.003


def test_a_unit_that_only_the_component_names_is_that_of_its_connector(tmp_path):
    files = {"resources/sub.ssp": packed(tmp_path, inner())}
    loaded = load(tmp_path, "resources/sub.ssp", files, unit="mm")
    (connection,) = loaded.connections
    # y m are 1000 y mm at the connector, again y m at u, then doubled
    assert (connection.factor, connection.offset) == (2.0, 0.0)


def test_units_that_contradict_are_refused(tmp_path):
    files = {"resources/sub.ssp": packed(tmp_path, inner("m"))}
    with pytest.raises(InputError, match=r"'in': unit mm is not that of resources/sub.ssp, m; mus"):
        load(tmp_path, "resources/sub.ssp", files, unit="mm")


def test_errors_name_the_way_to_the_place(tmp_path):
    files = {"resources/sub.ssp": packed(tmp_path, inner().replace('kind="input"', 'kind="up"'))}
    with pytest.raises(InputError) as error:
        load(tmp_path, "resources/sub.ssp", files)
    assert str(error.value).startswith(
        "hand.ssp: resources/sub.ssp: SystemStructure.ssd:2: against the schema: "
    )


def test_what_contains_itself_is_refused(tmp_path):
    loop = structure(system("s", component("b", type=DEFINITION, source="x.ssd")))
    with pytest.raises(InputError, match=r"^hand\.ssp: resources/x\.ssd: contains itself, which"):
        load(tmp_path, "resources/x.ssd", {"resources/x.ssd": loop.replace("input in", "")})


def again(inside=""):
    """A system with the id S, and a component that is another one like it."""
    shared = system("first", component("b", "input u") + inside, connect("in", "b/u"), "input in")
    shared = shared.replace('name="first"', 'name="first" id="S"')
    more = component("second", "input in", type=DEFINITION, source="#S")
    return system("top", component("a", "output y") + shared + more, connect("a/y", "second/in"))


def test_a_system_of_the_same_document_by_its_id(tmp_path):
    loaded = System.load(archive(tmp_path, structure(again()), {"a": GIVES, "b": TAKES}))
    assert [c.name for c in loaded.components] == ["a", "first_b", "second_b"]
    assert loaded.connections == (Connection(Port("a", "y"), Port("second_b", "u")),)


@pytest.mark.parametrize(
    ("inside", "source", "message"),
    [
        ("", "#T", "component 'second': source '#T': no system of the id 'T'; valid: S"),
        (
            component("loop", type=DEFINITION, source="#S"),
            "#S",
            "SystemStructure.ssd#S: contains itself, which is not allowed",
        ),
    ],
)
def test_ids_that_are_refused(tmp_path, inside, source, message):
    ssd = structure(again(inside).replace('"#S"', f'"{source}"'))
    with pytest.raises(InputError, match=r"^hand\.ssp: ") as error:
        System.load(archive(tmp_path, ssd, {"a": GIVES, "b": TAKES}))
    assert message in str(error.value)
