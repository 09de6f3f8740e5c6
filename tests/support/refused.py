"""FMUs that do not run here, each made of one that does by a change of its files."""

import re
import zipfile

import fmpy

from .compiled import binary
from .native_fmus import build, library_of

Files = dict[str, bytes]

CODE = """
double ceil(double), atan2(double, double), tanh(double), licence_check(double);
double of_libm(double x) { return ceil(x) + atan2(x, 2.0) + tanh(x); }
"""
MISSING = "double missing(double x) { return licence_check(x); }\n"


def _described(before, after):
    def change(files):
        xml = files["modelDescription.xml"].decode()
        assert before in xml
        return files | {"modelDescription.xml": xml.replace(before, after).encode()}

    return change


def _moved(folder):
    """The binaries for another machine, or as sources."""
    to = f"binaries/{folder}/native.{'dll' if folder.startswith('win') else 'so'}"
    to = "sources/native.c" if folder == "sources" else to
    return lambda files: {re.sub("^binaries/.*", to, name): data for name, data in files.items()}


def _without_binary(files):
    return {name: data for name, data in files.items() if not name.startswith("binaries/")}


def _one(files):
    """FMI 1.0, which has its kind in an element of its own; of ours that is enough to tell."""
    xml = files["modelDescription.xml"].decode().replace('fmiVersion="2.0"', 'fmiVersion="1.0"')
    xml = re.sub("<CoSimulation([^>]*)/>", "", xml)
    return files | {"modelDescription.xml": xml.encode()}


def _one_stepping(files):
    xml = _one(files)["modelDescription.xml"].decode()
    tool = "<Implementation><CoSimulation_StandAlone><Capabilities/></CoSimulation_StandAlone>"
    xml = xml.replace("</fmiModelDescription>", f"{tool}</Implementation></fmiModelDescription>")
    return files | {"modelDescription.xml": xml.encode()}


ASK = "ask the vendor for an export as FMI 2.0 or 3.0, for co-simulation"
HERE, HERE_3 = fmpy.platform, fmpy.platform_tuple
BINARY, BINARY_3 = (f"ask the vendor for an FMU with a binary for {p}" for p in (HERE, HERE_3))

KINDS = {
    "fmi 1.0": ("2.0", _one, "is FMI 1.0, for model exchange", ASK),
    "fmi 1.0 stepping": ("2.0", _one_stepping, "is FMI 1.0, for co-simulation", ASK),
    "scheduled": (
        "3.0",
        _described("<CoSimulation", "<ScheduledExecution"),
        "is for scheduled execution only",
        ASK,
    ),
}
"""What no machine runs: the version, the change, what is said of it, and what to ask for."""

BINARIES = {
    "windows": ("2.0", _moved("win64"), f"for win64 only; this machine: {HERE}", BINARY),
    "arm": ("3.0", _moved("aarch64-linux"), "has a binary for aarch64-linux only", BINARY_3),
    "sources": ("2.0", _moved("sources"), "is source-only, C without a binary", BINARY),
    "nothing": ("3.0", _without_binary, "has no binary at all", BINARY_3),
}
"""What this machine does not run."""


def refused(folder, name):
    """The FMU x.fmu of that kind in a folder."""
    version, change, *_ = (KINDS | BINARIES)[name]
    return changed(build(folder, "whole", version), folder / "x.fmu", change)


def changed(fmu, out, change):
    """A copy of an FMU with its files changed."""
    with zipfile.ZipFile(fmu) as archive:
        files = {n: archive.read(n) for n in archive.namelist() if not n.endswith("/")}
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in change(files).items():
            archive.writestr(name, data)
    return out


def linked(folder, missing=False):
    """An FMU whose binary leaves libm undefined, as Dymola's do; or also what is nowhere."""
    options = ("-fno-builtin", "-nostdlib", "-Wl,--unresolved-symbols=ignore-all", "-lc")
    return _with_library(folder, options, CODE + MISSING * missing)


def licensed(folder):
    """An FMU that logs that it finds no licence, with the path of its resources, and gives up."""
    return _with_library(folder, ["-DNO_LICENCE"])


def _with_library(folder, options, code=""):
    library = library_of("native", "2.0", more=options, code=code)
    place = binary("2.0", "native")
    whole = build(folder, "whole", "2.0")
    return changed(whole, folder / "x.fmu", lambda files: files | {place: library})
