"""The check of the English finds each kind of fault, and nothing in plain sentences."""

from pathlib import Path

import prose
import pytest

PAGE = Path("page.md")


def rules(text):
    return [finding.rule for finding in prose.page_findings(PAGE, text)]


@pytest.mark.parametrize(
    "text",
    [
        "# The step\n\nThe master sets the inputs. It then calls each FMU in order.\n",
        "Set `a; what is anew` first (see Eq. (9) of the paper).\n",
        "| key | meaning |\n|---|---|\n| `step` | communication step, s |\n",
        "What does a step cost? Section 3 gives the numbers.\n",
        "- **step**: the communication step.\n",
        "The sensor sends over the Controller Area Network (CAN). CAN is a bus.\n",
        "Run `source .venv/bin/activate`.\n\n```console\n$ grasp-cosim run\n```\n",
        "<!-- variables -->\nGenerated; from the code.\n<!-- end of variables -->\n",
    ],
)
def test_plain_english_passes(text):
    assert rules(text) == []


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("one " * 26 + "end.", "27 words in a sentence, at most 25"),
        ("## What it does\n", "name the thing instead of 'what'"),
        ("It shows what is sent.", "name the thing instead of 'what'"),
        ("Where a step fails, the run ends.", "write 'if' for a condition"),
        ("It ends; the log shows it.", "make it two sentences instead of ';'"),
        ("The run begins anew.", "write 'again', 'new' or 'from the start'"),
        ("It stands beside the file.", "write 'next to', 'and' or 'in addition to'"),
        ("The file alone is enough.", "write 'only' or 'on its own'"),
        ("The file says which step.", "a thing does not speak"),
        ("The reason is said there.", "name who reports it"),
        ("Fixed is the exponent.", "put the subject first"),
        ("A metric of your own.", "write 'its own X'"),
        ("A room imports another.", "use the common word"),
        ("**Isolation.** An FMU runs in a process.", "make the bold words a heading"),
        ("| word | is |\n|---|---|\n| a | b |\n", "name the column by a noun"),
        ("The sensor sends over CAN.", "explain the abbreviation"),
        ("    grasp-cosim run\n", "name `source .venv/bin/activate` once"),
        (f"    {'x' * 81}\n", "81 columns of code, at most 80"),
    ],
)
def test_a_fault_is_found_by_its_rule_alone(text, rule):
    (found,) = rules(f"{text}\n")
    assert found.startswith(rule)


@pytest.mark.parametrize(
    ("source", "line", "rule"),
    [
        ('"""Begins anew."""', 1, "write 'again'"),
        ("x = 1\n# A room\n# imports.", 2, "use the common word"),
        ('error = f"the file says {x}"', 1, "a thing does not speak"),
        (f'def f():\n    """{"one " * 26}."""', 2, "26 words in a sentence"),
    ],
)
def test_code_is_read_too(source, line, rule):
    (found,) = prose.code_findings(PAGE, source)
    assert (found.line, found.rule.startswith(rule)) == (line, True)


def test_the_glossary_explains_its_words_to_all_pages():
    assert {"SSP", "O-RLI"} <= prose.glossary()


def test_the_exit_code_is_1_where_there_is_a_finding(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    (tmp_path / "a.py").write_text("# begins anew\n", "utf-8")
    assert prose.main([str(tmp_path / "a.py")]) == 1
    assert capsys.readouterr().out.startswith("a.py:1: write 'again'")
    (tmp_path / "a.py").write_text("# begins again\n", "utf-8")
    assert prose.main([str(tmp_path / "a.py")]) == 0
