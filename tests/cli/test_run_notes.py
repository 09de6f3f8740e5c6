"""What `run` says of a system on standard error, before the first step and once."""

from support.native_fmus import TYPES, build, needs_gcc

pytestmark = needs_gcc

VERSION = "3.0"
REMARK = "first.y_Float64 -> second.u_Float64: second.u_Float64 has no unit, taken to be in m"


def two(folder, more=""):
    """Two parts, of which the second one's input has no unit; more are values of the second."""
    build(folder, "first", VERSION, units={"y_Float64": "m"})
    build(folder, "second", VERSION)
    starts = {"Boolean": "false", "String": "''", "Enumeration": "1"}
    others = ", ".join(f"u_{t} = {starts.get(t, '0')}" for t in list(TYPES[VERSION])[1:])
    path = folder / "two.toml"
    path.write_text(
        f"""connections = ["first.y_Float64 -> second.u_Float64"]
[experiment]
step = 0.1
stop = 1.0
[components.first]
fmu = "first.fmu"
values = {{ u_Float64 = 45.0, {others} }}
[components.second]
fmu = "second.fmu"
values = {{ {others}{more} }}
""",
        encoding="utf-8",
    )
    return path


def test_a_unit_taken_for_granted_is_said_once(command, tmp_path):
    code, _, err = command("run", two(tmp_path))
    assert code == 0
    assert err.splitlines().count(REMARK) == 1


def test_it_is_said_before_a_failure_that_names_the_inputs(command, tmp_path):
    code, out, err = command("run", two(tmp_path, ", error_at = 0.35"))
    assert (code, out) == (3, "")
    remark, *_, failure = err.splitlines()
    assert remark == REMARK
    assert failure.startswith("grasp-cosim: second: second.fmu returned error at t = 0.3 s")
    assert "(inputs: u_Float64 = 45, " in failure


def test_a_run_of_few_steps_is_remarked_on(command, tmp_path):
    said = (
        "two.toml: the whole run is 2 steps of 0.5 s, and values are passed on only between steps"
    )
    assert said in command("run", two(tmp_path), "--step", "0.5")[2]
    assert "whole run" not in command("run", two(tmp_path))[2]
