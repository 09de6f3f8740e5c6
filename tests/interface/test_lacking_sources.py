"""Whether the sources of an FMU compile as they are: advice is given only where they do."""

import pytest
from grasp_cosim.interface.obstacles import of_binary
from grasp_cosim.interface.read import describe
from ssp.hand_made import zipped

CODE = '#include "fmi2Functions.h"\n#include "model.h"\nint x;\n'
HEADER = "#define N 1\n"
BUILD = (
    '<fmiBuildDescription fmiVersion="3.0"><BuildConfiguration modelIdentifier="m">'
    '<SourceFileSet><SourceFile name="all.c"/></SourceFileSet></BuildConfiguration>'
    "</fmiBuildDescription>"
)
LISTED = '<SourceFiles><File name="all.c"/></SourceFiles>'


def declared(version, listed=LISTED):
    token = "instantiationToken" if version == "3.0" else "guid"
    inner = "" if version == "3.0" else listed
    return (
        f'<fmiModelDescription fmiVersion="{version}" modelName="m" {token}="1">'
        f'<CoSimulation modelIdentifier="m">{inner}</CoSimulation><ModelVariables/>'
        "</fmiModelDescription>"
    )


def remedy(folder, version="2.0", listed=LISTED, **files):
    """What is said of an FMU without a binary; files by name in sources, with _ for the dot."""
    sources = {"all_c": CODE, "model_h": HEADER, **files}
    entries = {
        f"sources/{'.'.join(name.rsplit('_', 1))}": text
        for name, text in sources.items()
        if text is not None
    }
    path = zipped(folder / "x.fmu", {"modelDescription.xml": declared(version, listed), **entries})
    return of_binary(describe(path)).remedy


def test_sources_that_are_whole(tmp_path):
    assert remedy(tmp_path).endswith("-lm fmpy compile FMU")
    assert remedy(tmp_path, "3.0", buildDescription_xml=BUILD).endswith("-lm fmpy compile FMU")


PREFIX = "#define FMI2_FUNCTION_PREFIX m_\n"


@pytest.mark.parametrize(
    ("version", "listed", "files", "reason"),
    [
        ("2.0", "", {}, "modelDescription.xml lists no source files"),
        ("3.0", "", {}, "there is no sources/buildDescription.xml"),
        ("3.0", "", {"buildDescription_xml": "<a"}, "buildDescription.xml cannot be read"),
        ("2.0", LISTED, {"all_c": None, "b_c": CODE}, "lists all.c, which is not there"),
        ("2.0", LISTED, {"model_h": None}, "sources/all.c includes model.h, which is not there"),
        ("2.0", LISTED, {"model_h": PREFIX}, "sources/model.h puts m_ before the names of the f"),
    ],
)
def test_what_is_seen_to_be_missing_is_said(tmp_path, version, listed, files, reason):
    text = remedy(tmp_path, version, listed, **files)
    assert "its sources do not compile as they are: " in text
    assert reason in text
    assert "fmpy compile" not in text


def test_a_prefix_that_cmake_leaves_out(tmp_path):
    guarded = f"#if !defined(m_EXPORTS)\n{PREFIX}#endif\n"
    assert "fmpy compile" in remedy(tmp_path, model_h=guarded)
