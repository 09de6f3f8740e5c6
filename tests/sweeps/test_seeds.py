"""Seeds of runs: another one in each, the same anywhere, in the table."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError, sweep
from grasp_cosim.sweeps.seeds import seeds_of_runs, with_row
from grasp_cosim.system.parts import Fault, Port
from support.marks import needs_compiler
from support.native_systems import integrator


@pytest.fixture
def noisy(grasp):
    return grasp.with_presets("bench").with_experiment(step=1e-3, stop=0.05)


def test_each_run_has_seeds_of_its_own_which_numpy_draws(noisy):
    found = seeds_of_runs(noisy, [{}, {"sensor_1.noise.seed": 7}, {}], "run")
    for run, number, place in ((0, 0, "sensor_1"), (2, 1, "sensor_2")):
        own = next(int(c.values.get("noise.seed", 1)) for c in noisy.components if c.name == place)
        drawn = np.random.SeedSequence((own, run, number)).generate_state(1)[0] % 10**9
        assert found[run][f"{place}.noise.seed"] == drawn
    assert "sensor_1.noise.seed" not in found[1]
    assert len({seed for of_run in found for seed in of_run.values()}) == 5


@needs_compiler
def test_alike_rows_differ_by_their_noise_and_the_table_has_the_seeds(noisy):
    def spread(run):
        return float(np.std(run["sensor_1.intensity"]))

    table = sweep(noisy, [{}] * 4, seed="run", metrics=[spread])
    assert len({*table["spread"]}) == 4
    assert (table.varied, len({*table["sensor_1.noise.seed"]})) == ((), 4)
    seeds = {"sensor_1.noise.seed": [int(table["sensor_1.noise.seed"][2])],
             "sensor_2.noise.seed": [int(table["sensor_2.noise.seed"][2])]}  # fmt: skip
    assert sweep(noisy, seeds, metrics=[spread])["spread"] == [table["spread"][2]]
    assert len({*sweep(noisy, {"experiment.stop": [0.05] * 2}, metrics=[spread])["spread"]}) == 1


@needs_compiler
def test_a_seed_that_is_recorded_too_is_no_signal_but_a_column(noisy):
    table = sweep(noisy, [{}] * 2, seed="run", signals="sensor_1.noise.*", native=True)
    signals = {f"sensor_1.noise.{name}" for name in ("enabled", "standard_deviation")}
    assert {*table.signals.store.arrays} == signals


def test_a_fault_has_its_seed_too(grasp):
    faults = (
        Fault(Port("controller", "intensity[1]"), "bias", {"value": 0.0}),
        Fault(
            Port("controller", "intensity[1]"),
            "noise",
            {"standard_deviation": 1e-4},
            seed=5,
        ),
    )
    system = replace(grasp, faults=faults)
    (found,) = seeds_of_runs(system, [{}], "run")
    assert [place for place in found if place.startswith("faults")] == ["faults[2].seed"]
    changed = with_row(system, {"faults[2].seed": 9, "plant.object_width": 0.06})
    assert [fault.seed for fault in changed.faults] == [0, 9]
    assert changed.start("plant.object_width") == 0.06


def test_what_is_not_random_has_no_seed(tmp_path, noisy):
    assert seeds_of_runs(noisy, [{}], None) == [{}]
    with pytest.raises(InputError, match=r"seed = 3: must be 'run', or None"):
        seeds_of_runs(noisy, [{}], 3)
    with pytest.raises(InputError, match=r"seed = 'run': nothing in system\.toml is random"):
        seeds_of_runs(integrator(tmp_path), [{}], "run")
    with pytest.raises(InputError, match="nothing varies"):
        sweep(noisy, [{}] * 2)
