"""The relative tolerance that an FMU is told."""

import pytest
from grasp_cosim import InputError, System, simulate
from support.native_fmus import needs_cvode, needs_gcc, talker

pytestmark = needs_gcc
versions = pytest.mark.parametrize("version", ["2.0", "3.0"])
BOTH = ("ModelExchange", "CoSimulation")


def system(folder, more=""):
    path = folder / "t.toml"
    component = f'[components.a]\nfmu = "talker.fmu"\n{more}'
    path.write_text(f"[experiment]\nstep = 0.5\nstop = 1.0\n{component}\n", "utf-8")
    return System.load(path)


@versions
@pytest.mark.parametrize(
    ("declared", "given", "told"),
    [
        (None, "", 0.0),
        (1e-6, "", 1e-6),
        (1e-6, "solver = { relative_tolerance = 1e-5 }", 1e-5),
        (None, "solver = { relative_tolerance = 1e-5 }", 1e-5),
        ("many", "", 0.0),
        (-1.0, "", 0.0),
    ],
)
def test_a_co_simulation_gets_the_tolerance(tmp_path, version, declared, given, told):
    talker(tmp_path, version=version, tolerance=declared)
    result = simulate(system(tmp_path, given))
    assert result["a.tolerance"].tolist() == [told] * 3
    component = result.settings["components"]["a"]
    assert "solver" not in component
    assert component.get("tolerance") == (1e-5 if given else None)


def test_so_it_does_in_a_process_of_its_own(tmp_path):
    talker(tmp_path, tolerance=1e-6)
    assert simulate(system(tmp_path, 'isolation = "process"'))["a.tolerance"][0] == 1e-6


@needs_cvode
@versions
def test_an_fmu_of_both_kinds_is_integrated_with_it(tmp_path, version):
    talker(tmp_path, version=version, kinds=BOTH, tolerance=1e-6)
    result = simulate(system(tmp_path, "solver = { relative_tolerance = 1e-5 }"))
    assert result["a.tolerance"].tolist() == [1e-5] * 3
    assert result.settings["components"]["a"]["solver"]["relative_tolerance"] == 1e-5


@pytest.mark.parametrize("entry", ["absolute_tolerance", "maximum_step"])
def test_a_solver_of_its_own_takes_no_more(tmp_path, entry):
    talker(tmp_path)
    message = (
        f"^t.toml: a: solver: {entry}: talker.fmu is for co-simulation only, with its own solver"
    )
    with pytest.raises(InputError, match=message):
        system(tmp_path, f"solver = {{ {entry} = 1e-3 }}")
