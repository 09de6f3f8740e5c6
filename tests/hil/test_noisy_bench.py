"""A bench that measures: no two answers are alike. It starts, and the grasp completes."""

import random

import pytest
from grasp_cosim import simulate
from grasp_cosim.hil.proxy_of_fmu import exchanged
from grasp_cosim.hil.served import ServedFmu, Service
from support.processes import kept_port
from support.proxies import ANY_PORT, build_proxy, serving_fmu

NOISE = {
    "position": 1e-5,
    "velocity": 1e-3,
    "gap": 1e-5,
    "contact_force": 1e-2,
    "object_position": 1e-5,
    "intensity": 1e-4,
    "force": 1e-3,
}
"""Standard deviations of what is measured, in SI units, by the beginnings of names."""


class NoisyFmu(ServedFmu):
    """An FMU whose Real outputs have noise whenever they are measured."""

    def __init__(self, fmu, seed):
        super().__init__(exchanged(fmu), Service(lockstep=True))
        rng, exact = random.Random(seed), self._fmu.outputs
        names = [v.name for v in self.peer.signature.answer]
        sizes = [next((s for n, s in NOISE.items() if name.startswith(n)), 0.0) for name in names]

        def measured():
            pairs = zip(exact(), sizes, strict=True)
            return [x + rng.gauss(0.0, size) if isinstance(x, float) else x for x, size in pairs]

        self._fmu.outputs = measured


@pytest.mark.parametrize(
    ("name", "seed"),
    [
        ("plant", 1),
        *(
            pytest.param(name, seed, marks=pytest.mark.slow)
            for seed in range(2, 7)
            for name in ("plant", "sensor_1", "controller")
        ),
    ],
)
def test_a_bench_with_noise_on_all_it_measures_starts_and_grasps(grasp, tmp_path, name, seed):
    system = grasp.with_experiment(step=4e-3, stop=3.0)
    fmu = system.component(name, "test").fmu
    proxy = build_proxy(fmu, tmp_path / "Bench.fmu", ANY_PORT)
    with kept_port() as port, serving_fmu(NoisyFmu(fmu, seed), ("127.0.0.1", port)):
        benched = system.swap(name, proxy).with_values({f"{name}.proxy.port": port})
        result = simulate(benched, engine="python")
    assert not any("t = 0" in line for line in result.log)
    assert None not in result.metrics["time_to_contact"]
    forces = [abs(result[f"controller.force[{j}]"]).max() for j in (1, 2)]
    assert max(forces) < 1.5 * 3.43
    assert result["plant.contact_force[1]"][-1] == pytest.approx(3.43, rel=0.1)
