"""The command and the tables of docs/how_to/real_time.md."""

import re
import shlex
from pathlib import Path

import pytest
from grasp_cosim import System, cli
from grasp_cosim.report.timing_words import PART_LABELS
from grasp_cosim.system.parts import Realtime
from support.marks import needs_compiler
from support.pages import BLOCKS, commands_of

PAGE = (Path(__file__).parents[2] / "docs/how_to/real_time.md").read_text("utf-8")
SHOWN = dict(BLOCKS.findall(PAGE))


def without_numbers(line):
    return re.sub(r"(?<![\w.])\d[\d.e+-]*\b", "N", line)


@pytest.mark.slow
@needs_compiler
def test_a_paced_run(checkout, capsys):
    ((command, shown),) = commands_of(SHOWN["console"])
    code = cli.main(shlex.split(command)[1:])
    printed = capsys.readouterr().out.splitlines()
    labels = ("paced at", "step computes", "start is late by")
    expected = [without_numbers(line) for line in shown.splitlines() if line.startswith(labels)]
    found = [without_numbers(line) for line in printed if line.startswith(labels)]
    assert found == expected
    assert len(found) == len(labels)
    assert [line for line in printed if line.startswith("overruns ")]
    passed = [line for line in printed if re.match(r"verdict +passed all \d criteria$", line)]
    assert code == (0 if passed else 1)
    assert (checkout / "results/run.json").is_file()


def test_its_table_goes_into_a_system_file(checkout):
    assert cli.main(["init", "paced.toml"]) == 0
    path = checkout / "paced.toml"
    path.write_text(f"{path.read_text('utf-8')}\n{SHOWN['toml']}", "utf-8")
    assert System.load(path).realtime == Realtime(priority=80, cpu=1, lock_memory=True)


def test_all_causes_are_named():
    (table,) = re.findall(r"\| cause \|.*?\n\n", PAGE, re.DOTALL)
    causes = set(re.findall(r"^\| ([a-z ]+) \|", table, re.MULTILINE)) - {"cause"}
    assert causes >= {PART_LABELS["start"], PART_LABELS["between"], "exchange", "recording"}
