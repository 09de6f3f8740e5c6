"""The block of tests/fmus/native/hand_written.h as native FMUs, without the translator."""

import importlib.util
import platform
import zipfile
from pathlib import Path

from grasp_fmus.contract import declared, variables
from grasp_fmus.description import Description, model_description
from grasp_fmus.native.sources import native_sources

from .compiled import compile_c

NAME = "HandWritten"
PYTHON = Path(__file__).parents[1] / "fmus" / "native" / "hand_written.py"
GUID = "{0f1e2d3c}"
CONTENT = "0123456789abcdef"
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")


def write_sources(folder, fmi=2):
    """The C sources, in a folder that is made."""
    folder.mkdir(parents=True)
    text = PYTHON.with_suffix(".h").read_text("utf-8")
    for file, data in native_sources(NAME, text, CONTENT, GUID, fmi).items():
        (folder / file).write_bytes(data)


def compile_in(folder, fmi=2, options=(), cc="gcc"):
    """The shared library of sources in a folder; without warnings."""
    plain = (f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX", *options, str(folder / f"{NAME}.c"), "-lm")
    return compile_c([cc, *FLAGS, *STRICT, *plain], folder / f"{NAME}.so")


def native_fmu(folder, fmi=2, options=()):
    """A native FMU for this machine, without what only a reader needs."""
    write_sources(folder / "sources", fmi)
    library = compile_in(folder / "sources", fmi, options)
    spec = importlib.util.spec_from_file_location(PYTHON.stem, PYTHON)
    assert spec
    assert spec.loader
    block = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(block)
    description = Description(NAME, "Mass", variables(declared(block)))
    place = "linux64" if fmi == 2 else f"{platform.machine()}-linux"
    fmu = folder / f"{NAME}.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        xml = model_description(description, GUID, fmi, native=True)
        archive.writestr("modelDescription.xml", xml)
        archive.write(library, f"binaries/{place}/{NAME}.so")
    return fmu
