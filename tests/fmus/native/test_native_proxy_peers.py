"""A native proxy with the peer in C, with a key or without: the same values, to the bit."""

import shutil
import subprocess
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import cli, simulate
from support.proxies import build_proxy

KEY = b"sixteen bytes of key, and some more"
STEP, STOP = 4e-3, 2.0

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc")]


@pytest.fixture(scope="module")
def target(fmus, tmp_path_factory):
    """The controller on a target, as docs/handoff.md makes it."""
    folder = tmp_path_factory.mktemp("target")
    assert cli.main(["build", "--native", "--c-only", str(folder), "GraspController"]) == 0
    header = ["--c-header", str(folder / "grasp_controller.h")]
    assert cli.main(["proxy", str(fmus / "GraspController.fmu"), *header]) == 0
    source = Path(__file__).parents[3] / "docs/controller_target.c"
    program = folder / "controller_target"
    files = [str(source), str(folder / "GraspController.c")]
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-I", str(folder)]
    subprocess.run(["gcc", *flags, *files, "-o", str(program), "-lm"], check=True)
    return program


@contextmanager
def running(target, key):
    """The target, until the end; its port."""
    words = [str(key)] if key else []
    with subprocess.Popen([target, "0", *words], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield int(process.stdout.readline().split()[-1])
        finally:
            process.kill()


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize("with_key", [False, True])
def test_with_the_peer_in_c(grasp, target, tmp_path, with_key, scheme):
    key = tmp_path / "key" if with_key else None
    values = {"controller.proxy.key_file": str(key or "")}
    if key:
        key.write_bytes(KEY)
        key.chmod(0o600)
    system = grasp.with_experiment(step=STEP, stop=STOP, scheme=scheme)
    fmu = system.component("controller", "test").fmu
    with running(target, key) as port:
        proxy = build_proxy(fmu, tmp_path / "Bench.fmu", port)
        there = simulate(system.swap("controller", proxy).with_values(values))
    direct = simulate(system)
    for signal, column in direct.items():
        np.testing.assert_array_equal(column, there[signal], signal)
    assert not there["controller.proxy.missed"].any()
