"""Puts together a native FMU but for its binaries: the C of NAME.c, and all that describes it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

from ..description import Version, build_description, model_description
from ..package import HASH, Model, hashed, python_members
from ..page import NATIVE, PROXY, licences, page
from .blocks import translated
from .text import string

C = Path(__file__).with_name("c")
OF_BLOCK = ("arithmetic.h", "block_slave.h")
OF_PROXY = ("sockets.h", "client.h", "channel.h", "proxy_slave.h")
ICONS = {2: "model.png", 3: "terminalsAndIcons/icon.png"}

_MAIN = """\
/* $name for FMI $fmi.0: the file to compile. It includes all others, and all in it but the
   functions of FMI is static: any number of such FMUs link into one program.

   The functions are called ${name}_fmi${fmi}DoStep and so on. FMI${fmi}_FUNCTION_PREFIX may be \
defined
   otherwise. For a shared library, where they are called fmi${fmi}DoStep, define
   FMI${fmi}_OVERRIDE_FUNCTION_PREFIX, as the standard says; CMake's ${name}_EXPORTS does too.

$how */

#if !defined(FMI${fmi}_FUNCTION_PREFIX) && !defined(${name}_EXPORTS)
#define FMI${fmi}_FUNCTION_PREFIX ${name}_
#endif

#if defined(_MSC_VER) && !defined(_CRT_SECURE_NO_WARNINGS)
#define _CRT_SECURE_NO_WARNINGS /* strcpy is given space for what it writes */
#endif
$system
#define TOKEN "$guid"
#define $defined
#define SLAVE "$slave"

$included
#include "fmi$fmi.h"
"""
_BLOCK = """\
   Compile as C99, without contraction (-ffp-contract=off) and never with -ffast-math: an FMU that
   would not calculate as its Python source does makes no instance and says why in the log."""
_PROXY = """\
   Compile as C99 and link with the sockets of the system: ws2_32 on Windows."""
_SYSTEM = """
#if !defined(_GNU_SOURCE) && !defined(_WIN32)
#define _GNU_SOURCE /* before the first header of the system: its sockets */
#endif
#if defined(_WIN32) && !defined(_CRT_RAND_S)
#define _CRT_RAND_S
#endif
"""


def native_members(model: Model, fmi: Version) -> dict[str, bytes]:
    """Return the files of the native FMU of a block but for its binaries, by name.

    In its states is the content of the FMU of the same block in Python, which exchanges them.
    UntranslatableError, one line, where the block holds what cannot be translated.
    """
    name = model.description.name
    content, _ = python_members(model)
    block = translated(name, model.block, model.file)
    return with_description(model, native_sources(name, block, content, HASH, fmi), fmi)


def native_sources(
    name: str, block: str, content: str, guid: str, fmi: Version
) -> dict[str, bytes]:
    """Return the files of sources/ by name; NAME.c is compiled, and includes all others with "".

    `block` is the block in C. `content` is the content hash of the FMU of the same block in Python,
    16 hexadecimal digits; `guid` is that of this FMU.
    """
    defined = f'CONTENT "{content}" /* of the FMU in Python, with which states are exchanged */'
    texts = {"how": _BLOCK, "system": "", "defined": defined}
    return _sources(name, guid, fmi, {"block.h": block}, OF_BLOCK, texts)


def proxy_sources(
    name: str, original: str, generated: Mapping[str, str], guid: str, fmi: Version
) -> dict[str, bytes]:
    """Return the same of a proxy of the FMU with the file name `original`.

    `generated` are the files that only this proxy has: the wire with its signature, its variables.
    """
    texts = {"how": _PROXY, "system": _SYSTEM, "defined": f"PROXY_ORIGINAL {string(original)}"}
    return _sources(name, guid, fmi, generated, OF_PROXY, texts)


def _sources(
    name: str,
    guid: str,
    fmi: Version,
    generated: Mapping[str, str],
    kind: Sequence[str],
    texts: Any,
) -> dict[str, bytes]:
    """Return NAME.c, own files, those that are the same in every FMU of a kind, and in all."""
    included = "\n".join(f'#include "{file}"' for file in generated)
    common = {"name": name, "fmi": fmi, "guid": guid, "slave": kind[-1], "included": included}
    files = [C / file for file in ("variable.h", "slave.h", *kind, f"fmi{fmi}.h")]
    files += sorted((C / "headers").glob(f"fmi{fmi}*.h"))  # of the FMI standard
    return {
        f"{name}.c": Template(_MAIN).substitute(texts, **common).encode(),
        **{file: text.encode() for file, text in generated.items()},
        **{file.name: file.read_bytes() for file in files},
    }


def with_description(model: Model, sources: Mapping[str, bytes], fmi: Version) -> dict[str, bytes]:
    """Return sources, which hold HASH for the GUID, as they are in an FMU, and all else in it.

    The GUID is a hash of description and sources, whatever it is compiled for and on.
    """
    d, networked = model.description, model.block is None
    _, files = hashed(
        {
            "modelDescription.xml": model_description(d, HASH, fmi, native=True),
            "sources/buildDescription.xml": build_description(d.name, networked),
            **{f"sources/{file}": data for file, data in sources.items()},
        }
    )
    html = page(d.name, d.summary, model.card, PROXY if networked else NATIVE, fmi)
    return {
        **files,
        **({ICONS[fmi]: model.picture} if model.picture else {}),
        "documentation/index.html": html.encode(),
        **licences("grasp-cosim"),
    }
