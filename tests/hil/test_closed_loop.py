"""The grasp with a part of it behind a proxy: the same values, to the bit, in lockstep."""

from contextlib import ExitStack, contextmanager

import numpy as np
import pytest
from grasp_cosim import simulate
from grasp_cosim.hil.served import Service
from support.marks import slow
from support.proxies import ANY_PORT, build_proxy, serving

ENGINE = "python"
"""The peers are threads of this process. The compiled loop keeps Python's lock to itself, where
another FMU is a Python one, and a native proxy in it then waits for a peer that cannot run."""

STEP, STOP = 4e-3, 2.0
"""s; past the contacts, in steps as long as the grasp takes them."""


@pytest.fixture(scope="module")
def stepped(grasp):
    return grasp.with_experiment(step=STEP, stop=STOP)


@contextmanager
def on_the_bench(system, folder, names, how):
    """The system with these components as proxies, each with a peer in lockstep of its own."""
    with ExitStack() as stack:
        for name in names:
            fmu = system.component(name, "test").fmu
            server = stack.enter_context(serving(fmu, how))
            proxy = build_proxy(fmu, folder / f"{name}_bench.fmu", ANY_PORT)
            port = {f"{name}.proxy.port": server.address[1]}
            system = system.swap(name, proxy).with_values(port)
        yield system


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize(
    "names",
    [slow(("plant", "sensor_1", "sensor_2", "controller")), ("controller",)],
    ids=["all", "controller"],
)
def test_a_part_on_the_bench_changes_no_bit(stepped, tmp_path, names, scheme):
    values = {"plant.initial_object_position": 0.02, "sensor_1.reflectance": 0.93}
    system = stepped.with_experiment(scheme=scheme).with_values(values)
    direct = simulate(system)
    with on_the_bench(system, tmp_path, names, Service(lockstep=True)) as benched:
        proxied = simulate(benched, engine=ENGINE)
    for signal, column in direct.items():
        np.testing.assert_array_equal(column, proxied[signal], signal)
    for name in names:
        assert not proxied[f"{name}.proxy.missed"].any()
        assert set(proxied[f"{name}.proxy.state"]) == {1}
        assert not proxied[f"{name}.proxy.age"].any()
    assert direct.metrics["time_to_contact"] == proxied.metrics["time_to_contact"]
    assert None not in direct.metrics["time_to_contact"]


@pytest.mark.slow
def test_native_and_python_mixed(stepped, natives, tmp_path):
    """Proxies of native and of Python FMUs, with peers that serve the other."""
    system, direct = stepped, simulate(stepped)
    for name in ("plant", "sensor_2"):
        fmu = natives / system.component(name, "test").fmu.name
        system = system.swap(name, fmu)
    with ExitStack() as stack:
        for name in ("plant", "sensor_1", "controller"):
            one = on_the_bench(system, tmp_path, (name,), Service(lockstep=True))
            system = stack.enter_context(one)
        again = simulate(system, engine=ENGINE)
    for signal, values in direct.items():
        np.testing.assert_array_equal(values, again[signal], signal)


def test_events_reach_the_bench(grasp, tmp_path):
    """A tunable parameter of a sensor on the bench, set on the way."""
    system = grasp.with_experiment(step=1e-3, stop=0.02)
    with on_the_bench(system, tmp_path, ("sensor_1",), Service(lockstep=True)) as benched:
        there, here = darkened(benched), darkened(system)
    np.testing.assert_array_equal(there, here)
    assert here[11] < 0.6 * here[10]


def darkened(system):
    """The intensity of a sensor before whose tenth step its side gets darker."""
    with simulate.session(system, engine=ENGINE) as session:
        session.step(10)
        session.set("sensor_1.reflectance", 0.57)
        session.step(10)
        return session.result()["sensor_1.intensity"]


@pytest.mark.slow
def test_two_runs_one_after_the_other_use_the_same_bench(grasp, tmp_path):
    system = grasp.with_experiment(step=1e-3, stop=0.05)
    with on_the_bench(system, tmp_path, ("plant",), Service(lockstep=True)) as benched:
        first, second = (simulate(benched, engine=ENGINE)["plant.position[1]"] for _ in range(2))
    np.testing.assert_array_equal(first, second)
