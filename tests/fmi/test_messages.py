"""What an FMU logs: what is asked of it, what arrives, and what is made of it."""

import logging
import subprocess
import sys

import pytest
from grasp_cosim import InputError, SimulationError, System, simulate
from grasp_cosim.fmi.instance import ERROR, OK, WARNING
from grasp_cosim.fmi.messages import MAX_KEPT, Message, Messages
from support.marks import engines, needs_pythonfmu, slow
from support.native_fmus import needs_gcc, talker

pytestmark = needs_gcc
everywhere = pytest.mark.parametrize(
    ("version", "isolation"),
    [("2.0", "none"), ("3.0", "none"), slow("2.0", "process"), ("3.0", "process")],
)


def system(folder, isolation="none", more=""):
    """The talker alone, in 10 steps of 0.1 s."""
    path = folder / "talk.toml"
    path.write_text(
        "[experiment]\nstep = 0.1\nstop = 1.0\n"
        f'[components.a]\nfmu = "talker.fmu"\nisolation = "{isolation}"\n{more}',
        "utf-8",
    )
    return System.load(path)


def shown(caplog):
    """The lines of FMUs that the command line shows, without --verbose."""
    return [
        r.getMessage() for r in caplog.records if r.name.startswith("grasp_cosim.fmi")
        and r.levelno >= logging.WARNING
    ]  # fmt: skip


@everywhere
def test_nothing_is_logged_unless_it_is_asked_for(tmp_path, caplog, version, isolation):
    talker(tmp_path, version=version)
    result = simulate(system(tmp_path, isolation))
    assert result["a.lines"][-1] == 0
    assert (shown(caplog), result.log) == ([], ())


@everywhere
@pytest.mark.parametrize("asked", ["true", '"logEvents"', '["logEvents", "logStatusError"]'])
def test_what_is_asked_for_is_shown(tmp_path, caplog, version, isolation, asked):
    talker(tmp_path, version=version)
    result = simulate(system(tmp_path, isolation, f"logging = {asked}"))
    lines = shown(caplog)
    assert result["a.lines"][-1] > 10
    assert "a: ok at t = 0.9 s: y is 1" in lines
    assert len(lines) > result["a.lines"][-1]
    assert result.log == ("a.lines changes each time it is read",)


def test_categories_that_were_not_asked_for_are_not_shown(tmp_path, caplog):
    """Though the FMU takes no notice of them."""
    talker(tmp_path, "-DDEAF")
    result = simulate(system(tmp_path, more='logging = "logStatusError"'))
    assert result["a.lines"][-1] > 10
    assert not shown(caplog)


@everywhere
@engines
def test_the_first_warning_and_how_many_followed_are_in_the_log(
    tmp_path, caplog, version, isolation, engine
):
    caplog.set_level(logging.INFO)
    talker(tmp_path, "-DWARNS_AFTER=0.65", version=version)
    result = simulate(system(tmp_path, isolation), engine=engine)
    assert result.log == ("a: warning at t = 0.6 s: y is 0.7; 3 more followed",)
    assert [r.getMessage() for r in caplog.records if "y is" in r.getMessage()] == [
        f"a: warning at t = {t:g} s: y is {t + 0.1:g}" for t in (0.6, 0.7, 0.8, 0.9)
    ]


@everywhere
@engines
def test_a_warning_that_is_returned_without_a_word_is_in_the_log(
    tmp_path, version, isolation, engine
):
    talker(tmp_path, "-DWARNS_AFTER=0.65", "-DMUTE", version=version)
    result = simulate(system(tmp_path, isolation), engine=engine)
    assert result.log == ("a: a call returned a warning at t = 0.6 s; 3 more followed",)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_warning_of_the_initialisation_is_in_the_log(tmp_path, version):
    talker(tmp_path, "-DAT_INITIALISATION=return 1", version=version)
    function = f"fmi{version[0]}EnterInitializationMode"
    assert simulate(system(tmp_path)).log == (
        f"a: warning at t = 0 s: {function} returned a warning",
    )


@everywhere
@pytest.mark.parametrize("asked", [False, slow(True)])
def test_a_failure_without_a_reason_says_how_to_get_one(tmp_path, version, isolation, asked):
    talker(tmp_path, "-DAT_STEP=if (time > 0.45) return 3", version=version)
    advice = "; components.a.logging = true may have it say why"
    with pytest.raises(SimulationError) as caught:
        simulate(system(tmp_path, isolation, "logging = true" if asked else ""))
    error = str(caught.value)
    assert error.startswith("a: talker.fmu returned error at t = 0.5 s")
    assert error.endswith(advice) is not asked


def test_so_does_a_refusal_of_the_initialisation(tmp_path):
    talker(tmp_path, "-DAT_INITIALISATION=return 3")
    message = (
        r"^a: talker.fmu refused its initialisation: fmi2EnterInitializationMode failed with "
        r"status 3 \(error\).; components.a.logging = true may have it say why$"
    )
    with pytest.raises(InputError, match=message):
        simulate(system(tmp_path))


def test_so_does_an_fmu_that_gives_no_instance(tmp_path):
    talker(tmp_path, "-DNO_INSTANCE")
    message = (
        r"^a: .*talker.fmu does not load: Failed to instantiate model; "
        r"components.a.logging = true may have it say why$"
    )
    with pytest.raises(InputError, match=message):
        simulate(system(tmp_path))
    with pytest.raises(InputError, match=r"does not load: no key$"):
        simulate(system(tmp_path, more="logging = true"))


@pytest.mark.parametrize("isolation", ["none", "process"])
def test_an_fmu_that_heeds_no_categories_is_silenced(tmp_path, isolation):
    """It would format each call for the sake of its warnings."""
    talker(tmp_path, "-DDEAF")
    lines = simulate(system(tmp_path, isolation))["a.lines"]
    assert 0 < lines[1] == lines[-1]


def test_an_fmu_without_such_categories_is_left_alone(tmp_path):
    talker(tmp_path, "-DDEAF", categories=("logEvents",))
    assert simulate(system(tmp_path))["a.lines"][-1] == 0


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ('"logCalls"', "talk.toml: a: logging: talker.fmu has no category 'logCalls'; valid: "),
        ("[]", r"talk.toml: components.a.logging = \[\]: must be true, false, the name"),
        ("3", "talk.toml: components.a.logging = 3: must be true, false, the name of a"),
        ('"logSecrets"', "a: .*talker.fmu does not take log categories: "),
    ],
)
def test_wrong_categories_are_refused(tmp_path, asked, message):
    talker(tmp_path)
    with pytest.raises(InputError, match=f"^{message}"):
        simulate(system(tmp_path, more=f"logging = {asked}"))


def test_categories_of_an_fmu_that_has_none_are_refused(tmp_path):
    talker(tmp_path, categories=())
    message = "^talk.toml: a: logging: talker.fmu declares no categories; must be true or false$"
    with pytest.raises(InputError, match=message):
        system(tmp_path, more='logging = "logEvents"')


def test_settings_of_a_command_line_name_categories(tmp_path):
    talker(tmp_path)
    plain = system(tmp_path)
    settings = {
        "true": True,
        "false": False,
        "logEvents,logStatusError": ("logEvents", "logStatusError"),
    }
    for text, logs in settings.items():
        made = plain.with_settings({"components.a.logging": text})
        assert made.components[0].logging == logs


def test_errors_take_the_last_messages_and_leave_the_warnings():
    messages = Messages("a", False, lambda: 0.5)
    for number in range(MAX_KEPT + 3):
        messages.take(WARNING, b"w%d" % number)
    messages.take(ERROR, b"the lamp\nis broken")
    assert messages.reasons() == [*(f"w{n}" for n in range(4, MAX_KEPT + 3)), "the lamp\nis broken"]
    assert messages.reasons() == []
    assert messages.remarks() == [f"a: warning at t = 0.5 s: w0; {MAX_KEPT + 2} more followed"]


def test_an_error_has_the_messages_of_its_step():
    messages = Messages("a", False, lambda: 0.5)
    messages.keep(Message(WARNING, "slow", 0.25))
    messages.take(WARNING, b"slower")
    messages.take(ERROR, b"stuck")
    assert messages.reasons() == ["slower", "stuck"]


def test_what_pythonfmu_says_of_an_exception_is_told_where_there_is_nothing_else():
    messages = Messages("a", False, lambda: 0.5)
    fatal = b"Fatal py exception encountered: [do_step] step\n"
    messages.take(ERROR, fatal + b"ValueError: no")
    messages.take(ERROR, b"a, t = 0.5 s: the lamp is broken")
    assert messages.reasons() == ["the lamp is broken"]
    messages.take(ERROR, fatal + b"ValueError: no")
    assert messages.reasons() == ["ValueError: no"]


@pytest.mark.parametrize(
    ("logged", "returned", "lines"),
    [
        (0, 0, []),
        (0, 1, ["a: a call returned a warning at t = 0.75 s"]),
        (0, 2, ["a: a call returned a warning at t = 0.75 s; 1 more followed"]),
        (1, 1, ["a: warning at t = 0.5 s: w"]),
        (2, 1, ["a: warning at t = 0.5 s: w; 1 more followed"]),
        (1, 3, ["a: warning at t = 0.5 s: w",
                "a: a call returned a warning at t = 0.75 s; 2 more followed"]),
    ],
)  # fmt: skip
def test_warnings_that_are_returned_are_told_where_fewer_were_logged(logged, returned, lines):
    messages = Messages("a", False, lambda: 0.5)
    for _ in range(logged):
        messages.take(WARNING, b"w")
    assert messages.remarks(returned, 0.75) == lines


def test_a_warning_that_a_function_returns_is_kept_where_it_logged_none():
    messages = Messages("a", False, lambda: 0.5)
    messages.returned("fmi2GetReal", messages.count)
    assert messages.remarks() == ["a: warning at t = 0.5 s: fmi2GetReal returned a warning"]
    since = messages.count
    messages.take(WARNING, b"w")
    messages.returned("fmi2GetReal", since)
    assert messages.count == 2
    saved = messages.saved()
    messages.take(ERROR, b"e")
    messages.restore(saved)
    assert (messages.count, len(messages.remarks())) == (2, 1)
    messages.forget()
    assert (messages.count, messages.remarks()) == (0, [])


def test_an_error_after_which_the_run_goes_on_is_a_remark():
    messages = Messages("a", False, lambda: 0.5)
    messages.keep(Message(ERROR, "no  disk", 0.25))
    assert messages.remarks(2, 0.75) == [
        "a: error at t = 0.25 s: no disk",
        "a: a call returned a warning at t = 0.75 s; 1 more followed",
    ]


def test_what_is_ignored_is_no_message():
    messages = Messages("a", True, lambda: 0.0)
    with messages.ignored():
        assert not messages.wants(WARNING, None)
    assert messages.wants(WARNING, None)
    assert messages.wants(OK, None)


SLAVE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real
from pythonfmu.enums import Fmi2Status


class Slave(Fmi2Slave):
    def __init__(self, **more):
        super().__init__(**more)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, time, step):
        if 0.1 < time < 0.3:
            self.log("not far from the end", Fmi2Status.warning)
        if time > 0.5:
            raise ValueError("no such place")
        return True
"""


@needs_pythonfmu
@pytest.mark.parametrize("isolation", ["none", slow("process")])
def test_the_exceptions_of_a_pythonfmu_slave_arrive(tmp_path, isolation):
    (tmp_path / "slave.py").write_text(SLAVE, "utf-8")
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", "slave.py"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "Slave.fmu").rename(tmp_path / "talker.fmu")
    message = r"^a: talker.fmu returned fatal at t = 0.6 s: ValueError\('no such place'\)"
    with pytest.raises(SimulationError, match=message) as caught:
        simulate(system(tmp_path, isolation))
    assert caught.value.result.log == ("a: warning at t = 0.2 s: not far from the end",)
