"""The block of tests/fmus/native/hand_written, as an FMU in Python and as native ones.

It does all that a block can do, and goes wrong in all ways; its C is not made by the translator.
"""

import importlib.util
import platform
import zipfile
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Literal

import fmpy
from grasp_fmus.build import build_block
from grasp_fmus.contract import declared, variables
from grasp_fmus.model_description import Description
from grasp_fmus.native.description import build_description, native_description
from grasp_fmus.native.sources import native_sources

from .compiled import compile_c

NAME = "HandWritten"
PYTHON = Path(__file__).parents[1] / "fmus" / "native" / "hand_written.py"
GUID = "{0f1e2d3c}"
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")


def block() -> ModuleType:
    """The block in Python."""
    spec = importlib.util.spec_from_file_location(PYTHON.stem, PYTHON)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def python_fmu(folder: Path) -> Path:
    """The FMU in Python."""
    return build_block(PYTHON, folder).path


def content(fmu: Path) -> str:
    """The content hash of an FMU in Python, which is its GUID."""
    return str(fmpy.read_model_description(fmu, validate=False).guid)


def write_sources(folder: Path, fmi: Literal[2, 3] = 2, content: str = "0123456789abcdef") -> None:
    """The C sources, in a folder that is made."""
    folder.mkdir(parents=True)
    translation = PYTHON.with_suffix(".h").read_text("utf-8")
    for file, data in native_sources(NAME, translation, content, GUID, fmi).items():
        (folder / file).write_bytes(data)


def compile_in(
    folder: Path, fmi: Literal[2, 3] = 2, options: Sequence[str] = (), cc: str = "gcc"
) -> Path:
    """The shared library of sources in a folder; without warnings."""
    library = folder / f"{NAME}.so"
    plain = f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX"
    return compile_c([cc, *FLAGS, *STRICT, plain, *options, folder / f"{NAME}.c", "-lm"], library)


def native_fmu(folder: Path, fmi: Literal[2, 3] = 2, content: str = "0123456789abcdef") -> Path:
    """A native FMU for this machine, without what only a reader needs."""
    write_sources(folder / "sources", fmi, content)
    library = compile_in(folder / "sources", fmi)
    description = Description(NAME, "Mass", variables(declared(block())))
    place = "linux64" if fmi == 2 else f"{platform.machine()}-linux"
    fmu = folder / f"{NAME}.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", native_description(description, GUID, fmi))
        archive.writestr("sources/buildDescription.xml", build_description(NAME, fmi))
        archive.write(library, f"binaries/{place}/{NAME}.so")
        for file in (folder / "sources").glob("*.[ch]"):
            archive.write(file, f"sources/{file.name}")
    return fmu
