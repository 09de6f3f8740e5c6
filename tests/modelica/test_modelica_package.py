"""The Modelica package as files: each class where Modelica tools look for it, by two parsers."""

import re
import tomllib
from pathlib import Path

import pytest
from docs.test_interoperability import ROWS
from support.foreign_tools import python_with, run_in

FOLDER = Path(__file__).parents[2] / "modelica"
PACKAGE = FOLDER / "GraspCosim"
FILES = sorted(PACKAGE.rglob("*.mo"))

PYMOCA = """
from pathlib import Path
import pymoca.parser
for path in given:
    try:
        tree = pymoca.parser.parse(Path(path).read_text("utf-8"))
        (package,) = (c for c in tree.classes.values() if c.type == "package")
        found.append(package.name)
    except pymoca.parser.ModelicaSyntaxError as error:
        found.append(f"error: {error}")
"""

MODELICA_BUILDER = """
from modelica_builder.modelica_parser import parse
for path in given:
    _, parser = parse(path)
    errors = parser.getNumberOfSyntaxErrors()
    found.append(f"error: {errors}" if errors else "GraspCosim")
"""

PARSERS = {"pymoca": PYMOCA, "modelica-builder": MODELICA_BUILDER}


@pytest.mark.interop
@pytest.mark.parametrize("tool", PARSERS)
def test_a_parser_reads_all_files(tool, tmp_path):
    (row,) = (r for r in ROWS if r.tool == tool)
    assert len(FILES) == int(row.value.split()[0])
    python = python_with(tool, row.version)
    broken = tmp_path / "broken.mo"
    broken.write_text("model M\n  Real x;\nequation\n  x = ;\nend M;\n", "utf-8")
    *parsed, refused = run_in(python, PARSERS[tool], tmp_path, [*map(str, FILES), str(broken)])
    assert parsed == ["GraspCosim"] * len(FILES)
    assert refused.startswith("error")


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_file_has_the_class_of_its_name_within_the_package_of_its_folder(path):
    text = path.read_text("utf-8")
    is_package = path.name == "package.mo"
    name = path.parent.name if is_package else path.stem
    enclosing = path.parents[1 if is_package else 0].relative_to(FOLDER).parts
    within = f"within {'.'.join(enclosing)};\n" if enclosing else ""
    assert re.match(rf"{within}(model|block|package) {name} \"[^\"]+\"\n", text)
    assert text.endswith(f"\nend {name};\n")


@pytest.mark.parametrize("folder", [PACKAGE, PACKAGE / "Examples"], ids=lambda p: p.name)
def test_the_order_of_a_package_has_all_its_classes(folder):
    listed = (folder / "package.order").read_text("utf-8").split()
    classes = {p.stem for p in folder.glob("*.mo")} - {"package"}
    assert sorted(listed) == sorted(classes | {p.parent.name for p in folder.glob("*/package.mo")})


def test_the_package_has_the_version_of_the_project():
    project = tomllib.loads((FOLDER.parent / "pyproject.toml").read_text("utf-8"))["project"]
    text = (PACKAGE / "package.mo").read_text("utf-8")
    assert re.findall(r'^    version = "(.*)",$', text, re.M) == [project["version"]]


def test_the_readme_has_all_files():
    text = (FOLDER / "README.md").read_text("utf-8")
    named = {*re.findall(r"`(GraspCosim/\w+\.mo)`", text)}
    assert named == {p.relative_to(FOLDER).as_posix() for p in FILES if p.parent == PACKAGE} - {
        "GraspCosim/package.mo"
    }
