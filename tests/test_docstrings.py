"""The docstrings of what users call: each argument, what comes out, and what is raised.

They are in Google's style, which editors show argument by argument: see CONTRIBUTING.md.
"""

import ast
import dataclasses
import inspect
import re
from textwrap import dedent

import grasp_cosim
import pytest
from grasp_cosim.comparison.bands import Band, Bands, Compared, read_bands
from grasp_cosim.comparison.compare import Comparison
from grasp_cosim.comparison.outcome import ComparisonData, QualificationData, Swap
from grasp_cosim.comparison.qualify import Qualification
from grasp_cosim.grasp.identification.identification import Identification
from grasp_cosim.linearisation.state_space import Margins
from grasp_cosim.master.session import State
from grasp_cosim.recording.log_names import read_log_names
from grasp_cosim.recording.recorded_run import RecordedRun
from grasp_cosim.ssp.to_archive import Written
from grasp_cosim.sweeps.table import Table

PUBLIC = [getattr(grasp_cosim, name) for name in grasp_cosim.__all__]
RETURNED = [Band, Bands, Compared, Comparison, Qualification, Swap, Identification, Margins]
RETURNED += [State, Table, Written, RecordedRun, ComparisonData, QualificationData]
CLASSES = [thing for thing in PUBLIC if inspect.isclass(thing)] + RETURNED
FUNCTIONS = [thing for thing in PUBLIC if not inspect.isclass(thing)]
FUNCTIONS += [read_bands, read_log_names]
RESULTS = [grasp_cosim.Result, grasp_cosim.StateSpace, *RETURNED]
"""Classes of which a user gets objects, and reads their attributes."""

ERRORS = ("InputError", "SimulationError", "RunInterruptedError", "KeyError", "KeyboardInterrupt")
SECTION = re.compile(r"(Args|Returns|Raises|Attributes):")
ENTRY = re.compile(r"    (\*{0,2}\w+): \S")


def methods_of(cls):
    """The public methods that a class, or a base of it here, defines, and its brackets."""
    for base in inspect.getmro(cls):
        if not base.__module__.startswith("grasp_cosim"):
            continue
        for name, member in vars(base).items():
            function = getattr(member, "__func__", member)
            if inspect.isfunction(function) and (name[0] != "_" or name == "__getitem__"):
                yield function


CALLED = list(dict.fromkeys([*FUNCTIONS, *(m for cls in CLASSES for m in methods_of(cls))]))


def sections_of(text):
    """The lines of a docstring by section; "" is what stands before them."""
    sections = {"": []}
    name = ""
    for line in text.splitlines():
        if heading := SECTION.fullmatch(line):
            name = heading[1]
            assert name not in sections
            sections[name] = []
        else:
            sections[name].append(line)
    return sections


def entries_of(sections, name):
    """The names that a section documents, each followed by its text."""
    return [found[1] for line in sections.get(name, []) if (found := ENTRY.match(line))]


def parameters_of(function):
    """The names of the parameters, as a docstring has them."""
    stars = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
    parameters = inspect.signature(function).parameters.values()
    return [f"{stars.get(p.kind, '')}{p.name}" for p in parameters if p.name not in ("self", "cls")]


def raised_in(function):
    """The errors that stand behind a raise in the source of a function itself."""
    tree = ast.parse(dedent(inspect.getsource(function)))
    raised = (node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise) and node.exc)
    names = {getattr(error.func, "id", "") for error in raised if isinstance(error, ast.Call)}
    return names & {*ERRORS}


def check(function, text):
    """The parts of the docstring of what is called."""
    sections = sections_of(text)
    assert entries_of(sections, "Args") == parameters_of(function)
    raised = entries_of(sections, "Raises")
    assert {*raised} <= {*ERRORS}
    assert len(raised) == len({*raised})
    assert raised_in(function) <= {*raised}
    prose = [line for name in sections if name != "Raises" for line in sections[name]]
    assert not re.search(r"\b(InputError|KeyError)\b", "\n".join(prose))
    summary, *description = sections[""]
    assert summary.endswith((".", ":"))
    assert not description or not description[0]


@pytest.mark.parametrize("function", CALLED, ids=lambda function: function.__qualname__)
def test_each_argument_is_documented_and_what_comes_out(function):
    text = inspect.getdoc(function)
    check(function, text)
    returned = inspect.signature(function).return_annotation
    gives_something = returned not in (None, "None", inspect.Signature.empty)
    assert ("Returns" in sections_of(text)) == gives_something


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_each_argument_of_a_class_is_documented(cls):
    if cls in RESULTS or issubclass(cls, Exception | KeyboardInterrupt):
        return
    text = inspect.getdoc(cls)
    if not dataclasses.is_dataclass(cls) or not cls.__dataclass_params__.init:
        text = f"{inspect.getdoc(cls)}\n{inspect.getdoc(cls.__init__)}"
    sections = sections_of(text)
    assert entries_of(sections, "Args") == parameters_of(cls)


@pytest.mark.parametrize("cls", RESULTS, ids=lambda cls: cls.__name__)
def test_each_attribute_of_a_result_is_documented_where_editors_look(cls):
    (tree,) = ast.parse(dedent(inspect.getsource(cls))).body
    for field, text in zip(tree.body, [*tree.body[1:], None], strict=True):
        if isinstance(field, ast.AnnAssign):
            assert isinstance(text, ast.Expr), field.target.id
            assert isinstance(text.value.value, str), field.target.id
        elif isinstance(field, ast.FunctionDef) and not field.name.startswith("_"):
            assert ast.get_docstring(field), field.name


def test_each_argument_of_an_environment_is_documented():
    pytest.importorskip("gymnasium")
    from grasp_cosim.gym import Environment

    for method in (Environment.__init__, *methods_of(Environment)):
        check(method, inspect.getdoc(method))


def test_a_run_is_a_function_whose_sessions_are_beside_it():
    assert inspect.isfunction(grasp_cosim.simulate)
    assert grasp_cosim.simulate.session is grasp_cosim.Session
    assert [*inspect.signature(grasp_cosim.simulate).parameters][:3] == ["system", "step", "stop"]
