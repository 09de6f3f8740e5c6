"""Which structure of an archive is read: the one that is named, the usual one, or the only one."""

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.system.parts import NANOSECONDS
from ssp.hand_made import archive, component, entries_of, fmu, structure, system, zipped

FMU = fmu("parameter Real k 1.0")
SOURCE = "resources/a.fmu"


def stopping(stop):
    top = system("top", component("a", source=SOURCE))
    return structure(top, f'<ssd:DefaultExperiment stopTime="{stop}"/>')


def variants(folder, **stops):
    """An archive with structures by name, told apart by their stop times."""
    entries = entries_of(archive(folder, stopping(9), {"a": FMU}))
    del entries["SystemStructure.ssd"]
    structures = {f"{name}.ssd": stopping(stop) for name, stop in stops.items()}
    return zipped(folder / "hand.ssp", structures | entries)


def stop_of(loaded):
    return loaded.stop_ns / NANOSECONDS


@pytest.mark.parametrize(("variant", "stop"), [(None, 1), ("B", 2), ("B.ssd", 2)])
def test_a_variant_is_read_by_its_name(tmp_path, variant, stop):
    path = variants(tmp_path, SystemStructure=1, B=2)
    assert stop_of(System.load(path, variant=variant)) == stop


def test_the_notes_and_the_name_say_which(tmp_path):
    path = variants(tmp_path, SystemStructure=1, B=2)
    loaded = System.load(path, variant="B")
    assert loaded.name == "hand.ssp#B.ssd"
    said = "variant SystemStructure.ssd is not used, B.ssd is; --set experiment.variant="
    assert f"{said}SystemStructure takes it" in loaded.notes


def test_the_only_structure_is_read_whatever_its_name(tmp_path):
    loaded = System.load(variants(tmp_path, Fuel_system=3))
    assert (stop_of(loaded), loaded.name) == (3, "hand.ssp")
    assert "hand.ssp: its only structure is Fuel_system.ssd, which is read" in loaded.notes


def test_the_only_structure_may_be_in_the_one_folder(tmp_path):
    entries = entries_of(variants(tmp_path, Fuel_system=3))
    moved = {f"my system/{name}": data for name, data in entries.items()}
    path = zipped(tmp_path / "hand.ssp", moved | {"__MACOSX/my system/._x": b""})
    assert stop_of(System.load(path)) == 3


REFUSED = {
    "no such variant": (
        {"SystemStructure": 1, "B": 2},
        "C",
        "hand.ssp: no variant 'C'; valid: SystemStructure, B",
    ),
    "several and no usual one": (
        {"A": 1, "B": 2},
        None,
        "hand.ssp: has no SystemStructure.ssd, but the variants A, B; must be chosen: "
        "--set experiment.variant=A",
    ),
    "none": ({}, None, "hand.ssp: no SystemStructure.ssd in it; must be an SSP archive"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_read_is_one_line(tmp_path, name):
    stops, variant, said = REFUSED[name]
    path = variants(tmp_path, **stops)
    with pytest.raises(InputError) as error:
        System.load(path, variant=variant)
    assert str(error.value).removeprefix(f"{tmp_path}/") == said


def test_a_variant_is_chosen_where_a_system_is_read(tmp_path, grasp):
    loaded = System.load(variants(tmp_path, SystemStructure=1, B=2))
    for changed in (loaded, grasp):
        with pytest.raises(InputError, match=r"chosen as it is read: --set experiment\.variant="):
            changed.with_settings({"experiment.variant": "B"})
    (tmp_path / "s.toml").write_text("")
    with pytest.raises(InputError, match=r"only an \.ssp may have variants"):
        System.load(tmp_path / "s.toml", variant="B")


def test_the_command_line_sets_it(tmp_path, command):
    variants(tmp_path, SystemStructure=1, B=2)
    code, _, _ = command("ssp", "hand.ssp", "--set", "experiment.variant=B", "-o", "out.ssp")
    assert (code, stop_of(System.load("out.ssp"))) == (0, 2)
    code, _, err = command("ssp", "--set", "experiment.variant=B", "-o", "out.ssp", "--json")
    assert (code, "the built-in system has no variants" in err) == (2, True)
