"""What [record] of a system file names: which signals are recorded, in which order, and when."""

from dataclasses import replace
from fractions import Fraction

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.system.record import Pattern, Record
from grasp_cosim.system.settings import run_settings
from support.native_fmus import state_space

VARIABLES = """
    <Float64 name="y" valueReference="0" causality="output"/>
    <Float64 name="gap[1]" valueReference="1" causality="output" unit="m"/>
    <Float64 name="gap1" valueReference="2" causality="output"/>
    <Float64 name="engine.speed" valueReference="3" causality="local"/>
    <Float64 name="engine.k" valueReference="4" causality="parameter" variability="fixed"
             start="1"/>
    <Float64 name="u" valueReference="5" causality="input" start="0"/>
    <String name="engine.mode" valueReference="6" causality="local"/>
    <Binary name="image" valueReference="7" causality="local"/>
    <Float64 name="tau" valueReference="8" causality="calculatedParameter" variability="fixed"/>
    <Float64 name="time" valueReference="9" causality="independent" variability="continuous"/>
"""
INNER = '<Float64 name="x" valueReference="1" causality="local"/>'
SYSTEM = """
[experiment]
step = 0.1
stop = 1.0
[components.b]
fmu = "b.fmu"
values = { u = 0.0 }
[components.a]
fmu = "a.fmu"
"""
ALL_OF_B = [
    *("b.y", "b.gap[1]", "b.gap1", "b.engine.speed", "b.engine.k"),
    *("b.u", "b.engine.mode", "b.tau"),
]


def fmu(path, variables):
    import zipfile

    text = (
        '<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="m">'
        '<CoSimulation modelIdentifier="m"/>'
        f"<ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("record")
    fmu(made / "b.fmu", VARIABLES)
    fmu(made / "a.fmu", INNER)
    return made


@pytest.fixture
def load(folder):
    def system(record=""):
        (folder / "s.toml").write_text(SYSTEM + record, "utf-8")
        return System.load(folder / "s.toml")

    return system


def names(system):
    return [str(port) for port in system.recorded]


def test_by_default_the_outputs_are_recorded_and_locals_where_there_are_none(load):
    system = load()
    assert names(system) == ["b.y", "b.gap[1]", "b.gap1", "a.x"]
    assert system.record == Record()


@pytest.mark.parametrize(
    ("signals", "recorded"),
    [
        (["*"], [*ALL_OF_B, "a.x"]),
        (["b.*"], ALL_OF_B),
        (["a.x", "b.u"], ["b.u", "a.x"]),
        (["b.gap[1]"], ["b.gap[1]"]),
        (["b.gap?"], ["b.gap1"]),
        (["b.gap*"], ["b.gap[1]", "b.gap1"]),
        (["b.*[?]"], ["b.gap[1]"]),
        (["b.engine.*"], ["b.engine.speed", "b.engine.k", "b.engine.mode"]),
        (["*.x", "b.tau"], ["b.tau", "a.x"]),
        (["b.time"], ["b.time"]),
        (["!b.gap[1]"], ["b.y", "b.gap1", "a.x"]),
        (["!a.*"], ["b.y", "b.gap[1]", "b.gap1"]),
        (["!b.engine.*", "b.*"], ["b.y", "b.gap[1]", "b.gap1", "b.u", "b.tau"]),
        (["b.y", "b.*", "!b.*g*"], ["b.y", "b.u", "b.tau"]),
        ([], ["b.y", "b.gap[1]", "b.gap1", "a.x"]),
    ],
)
def test_a_pattern_takes_in_or_leaves_out_in_the_order_of_the_system(load, signals, recorded):
    """* stands for any text, ? for a character; brackets are letters like all else."""
    assert names(load(f"[record]\nsignals = {signals!r}")) == recorded
    assert names(load().with_record(*signals)) == recorded
    assert names(load().with_record(*reversed(signals))) == recorded


@pytest.mark.parametrize(
    ("record", "message"),
    [
        ('signals = ["b.gap[2]"]', "s.toml: record.signals: 'b.gap[2]' matches no signal; did you"
         " mean b.gap[1]?"),
        ('signals = ["b.y", "c.*"]', "s.toml: record.signals: 'c.*' matches no signal; valid: "),
        ('signals = ["!b.image"]', "s.toml: record.signals: '!b.image' is of type Binary: b.image "
         "cannot be recorded; must be Real, Integer, Boolean, String"),
        ('signals = ["b.imag*"]', "s.toml: record.signals: 'b.imag*' is of type Binary: b.image "),
        ('signals = [""]', "s.toml: record.signals: '' matches no signal; "),
        ("signals = [3]", "s.toml: record.signals[0] = 3: must be a name like 'plant.gap[1]', or "
         "'plant.*'"),
        ('signals = "b.y"', "s.toml: record.signals = 'b.y': must be a list, like ['plant.*']"),
        ('signal = ["b.y"]', "s.toml: [record]: unknown entry 'signal'; did you mean signals?"),
    ],
)  # fmt: skip
def test_what_records_nothing_is_refused_with_the_nearest_names(load, record, message):
    with pytest.raises(InputError) as caught:
        load(f"[record]\n{record}")
    assert str(caught.value).replace('["', "['").replace('"]', "']").startswith(message)


@pytest.mark.parametrize(
    ("both", "see"), [(True, "`grasp-cosim inspect FMU`"), (False, "`grasp-cosim inspect b.fmu`")]
)
def test_the_command_that_lists_the_variables_is_named(load, folder, both, see):
    """Where there is one FMU, with its path."""
    load()
    text = SYSTEM if both else SYSTEM.partition("[components.a]")[0]
    (folder / "one.toml").write_text(f'{text}[record]\nsignals = ["zzzzzzzz"]\n', "utf-8")
    with pytest.raises(InputError) as caught:
        System.load(folder / "one.toml")
    assert see in str(caught.value).replace(f"{folder}/", "")


def test_with_record_refuses_by_name(load):
    with pytest.raises(InputError, match=r"^record: 'b.gab\[1\]' matches no signal; did you mean"):
        load().with_record("b.gab[1]")


def test_a_pattern_is_checked_up_to_the_first_signal_that_it_matches(load, monkeypatch):
    """FMUs have 100,000 variables, and each change of a system checks again."""
    system, takes, compared = load(), Pattern.takes, []

    def counted(one, component, variable):
        compared.append(variable.name)
        return takes(one, component, variable)

    monkeypatch.setattr(Pattern, "takes", counted)
    Record(("b.gap*", "!b.y")).check("record:", system.components)
    assert compared == ["y", "gap[1]", "y"]


def test_an_array_stands_for_its_elements(tmp_path):
    state_space(tmp_path, binary=False)
    text = '[experiment]\nstep = 0.1\nstop = 1.0\n[components.a]\nfmu = "ss.fmu"\n'
    (tmp_path / "s.toml").write_text(text, "utf-8")
    system = System.load(tmp_path / "s.toml")
    assert names(system) == ["a.y[1]", "a.y[2]", "a.y[3]"]
    assert names(system.with_record("a.x")) == ["a.x[1]", "a.x[2]", "a.x[3]"]
    assert names(system.with_record("a.A[1,2]", "a.x[3]")) == ["a.A[1,2]", "a.x[3]"]
    assert names(system.with_record("a.?")) == names(
        system.with_record(*(f"a.{name}" for name in "ABCDuyxmnrk"))
    )


def test_a_list_of_a_command_line_has_commas_but_in_brackets():
    listed = Record().with_texts(["b.y, a.A[1,2],a.f(x,y)", "!c.*"])
    assert listed.signals == ("b.y", "a.A[1,2]", "a.f(x,y)", "!c.*")


def test_what_another_fmu_does_not_have_is_left_out_with_a_note(load, folder):
    fmu(folder / "other.fmu", '<Float64 name="y" valueReference="0" causality="output"/>')
    swapped = load().with_record("b.y", "b.engine.speed", "a.x").swap("b", folder / "other.fmu")
    assert names(swapped) == ["b.y", "a.x"]
    said = "record: 'b.engine.speed' matches no signal any more: it is left out"
    assert said in swapped.notes


def test_a_component_may_be_called_record(folder):
    text = SYSTEM.replace("components.a", "components.record")
    (folder / "r.toml").write_text(text + '[record]\nsignals = ["record.x"]', "utf-8")
    assert names(System.load(folder / "r.toml")) == ["record.x"]


def test_a_list_in_the_place_of_names_is_refused(grasp):
    with pytest.raises(InputError, match=r"^record: \['plant.\*'\]: must be a name; several are"):
        grasp.with_record(["plant.*"])


TRIGGERED = 'trigger = "b.y > 0.5"\nbefore = 0.25\nafter = "1/3"'


def test_a_trigger_is_read_set_and_taken_away(load):
    """In a file, by --set, in Python; times are exact, and signals are chosen as without it."""
    system = load(f'[record]\nsignals = ["a.*"]\n{TRIGGERED}')
    trigger = system.record.trigger
    assert (str(trigger.when), names(system)) == ("b.y > 0.5", ["a.x"])
    assert (trigger.before_ns, trigger.after_ns) == (250_000_000, Fraction(10**9, 3))
    assert run_settings(system)["trigger"] == {"when": "b.y > 0.5", "before": 0.25, "after": 1 / 3}
    assert "trigger" not in run_settings(load())
    texts = {"record.trigger": "b.y > 0.5", "record.before": "0.25", "record.after": "1/3"}
    assert load().with_settings(texts).record.trigger == trigger
    again = load().with_record("a.*", trigger="b.y > 0.5", before=(250, "ms"), after="1/3")
    assert again.record == system.record
    later = system.with_settings({"record.after": 2})
    assert later.record.trigger == replace(trigger, after_ns=2 * 10**9)
    assert names(later) == ["a.x"]
    assert later.with_record("b.y").record.trigger == later.record.trigger
    assert system.with_settings({"record.trigger": "false"}).record == Record(("a.*",))
    assert system.with_record("a.*", trigger=False).record == Record(("a.*",))
    alone = load().with_record(trigger="b.u >= 0", after=0)  # of a signal that is not recorded
    assert (alone.record.trigger.before_ns, alone.record.trigger.after_ns) == (0, 0)


@pytest.mark.parametrize(
    ("record", "message"),
    [
        ('trigger = "b.x > 1"\nafter = 1', "s.toml: record.trigger = 'b.x > 1.0': b has no number"
         " 'x'; "),
        ('trigger = "c.y > 1"\nafter = 1', "s.toml: record.trigger = 'c.y > 1.0': no component "
         "'c'; "),
        ("trigger = \"b.engine.mode == 'on'\"\nafter = 1", "s.toml: record.trigger = "
         "'b.engine.mode == 'on'': b has no number 'engine.mode'; "),
        ('trigger = "b.y == 1"\nafter = 1', "s.toml: record.trigger = 'b.y == 1.0': b.y is Real; "
         "must be compared with a finite number, by <, <=, >, >="),
        ('trigger = "b.y"\nafter = 1', "s.toml: record.trigger = 'b.y': must be like 'plant.gap"),
        ("trigger = 1\nafter = 1", "s.toml: record.trigger = 1: must be like 'plant.gap[1] < 0"),
        ('trigger = "b.y > 1"', "s.toml: record.after: no entry; a trigger must have one, a time "),
        ('trigger = "b.y > 1"\nafter = -1', "s.toml: record.after = -1 s: must be a number from 0"),
        ('trigger = "b.y > 1"\nafter = 1\nbefore = -0.5', "s.toml: record.before = -0.5 s: must be "
         "a number from 0 to "),
        ("before = 0.5", "s.toml: record.before = 0.5: there is no trigger; must have one, like "),
        ("after = 0.5", "s.toml: record.after = 0.5: there is no trigger; must have one, like "),
        ('triger = "b.y > 1"', "s.toml: [record]: unknown entry 'triger'; did you mean trigger?"),
    ],
)  # fmt: skip
def test_a_trigger_that_cannot_be_is_refused_in_a_line(load, record, message):
    with pytest.raises(InputError) as caught:
        load(f"[record]\n{record}")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_a_component_may_still_be_called_record(folder):
    text = SYSTEM.replace("components.a", "components.record")
    (folder / "named.toml").write_text(f"{text}[record]\n{TRIGGERED}", "utf-8")
    system = System.load(folder / "named.toml")
    assert system.record.trigger is not None
    with pytest.raises(InputError, match="trigger"):
        system.with_settings({"record.trigger": "b.y > 1"})  # a variable of that component
