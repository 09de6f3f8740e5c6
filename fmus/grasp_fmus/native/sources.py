"""Puts together the C sources of a native FMU: one file to compile, which includes the others."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from .text import string

C = Path(__file__).with_name("c")
COMMON = ("variable.h", "slave.h")
"""Of every slave."""
PROXY = ("sockets.h", "client.h", "connection.h", "proxy_slave.h")
HEADERS = {
    2: ("fmi2TypesPlatform.h", "fmi2FunctionTypes.h", "fmi2Functions.h"),
    3: ("fmi3PlatformTypes.h", "fmi3FunctionTypes.h", "fmi3Functions.h"),
}
"""Of the FMI standard, by its version."""

_MAIN = """\
/* {name} for FMI {fmi}.0: the file to compile. It includes all others, and all in it but the
   functions of FMI is static: any number of such FMUs link into one program.

   The functions are called {name}_fmi{fmi}DoStep and so on. FMI{fmi}_FUNCTION_PREFIX may be defined
   otherwise. For a shared library, where they are called fmi{fmi}DoStep, define
   FMI{fmi}_OVERRIDE_FUNCTION_PREFIX, as the standard says; CMake's {name}_EXPORTS does as well.

{how} */

#if !defined(FMI{fmi}_FUNCTION_PREFIX) && !defined({name}_EXPORTS)
#define FMI{fmi}_FUNCTION_PREFIX {name}_
#endif

#if defined(_MSC_VER) && !defined(_CRT_SECURE_NO_WARNINGS)
#define _CRT_SECURE_NO_WARNINGS /* strcpy and strcat are given room for what they write */
#endif
{defined}
#define TOKEN "{guid}"
{included}
#include "fmi{fmi}.h"
"""

_BLOCK = """\
   Compile as C99, without contraction (-ffp-contract=off) and never with -ffast-math: an FMU that
   would not calculate as its Python source does makes no instance and says why in the log."""
_PROXY = """\
   Compile as C99 and link with the sockets of the system: ws2_32 on Windows; where the C library is
   older than glibc 2.34, pthread and dl."""

_SYSTEM = """
#if !defined(_GNU_SOURCE) && !defined(_WIN32)
#define _GNU_SOURCE /* before the first header of the system: its sockets, threads and libraries */
#endif
#if defined(_WIN32) && !defined(_CRT_RAND_S)
#define _CRT_RAND_S
#endif
"""


def native_sources(
    name: str, block: str, content: str, guid: str, fmi: Literal[2, 3]
) -> dict[str, bytes]:
    """Return the files of sources/ by name, for FMI `fmi`; NAME.c is the one to compile.

    `block` is the block in C, block.h. `content` is the content hash of the FMU of the
    same block in Python, 16 hexadecimal digits, which is in states; `guid` is that of this FMU.
    """
    included = (
        f'#define CONTENT "{content}" /* of the FMU in Python with which states are exchanged */'
        '\n\n#include "block.h"'
    )
    main = _MAIN.format(name=name, fmi=fmi, guid=guid, how=_BLOCK, defined="", included=included)
    return {
        f"{name}.c": main.encode(),
        "block.h": block.encode(),
        **_files("arithmetic.h", "block_slave.h", fmi=fmi),
    }


def proxy_sources(
    name: str, original: str, own: Mapping[str, str], guid: str, fmi: Literal[2, 3]
) -> dict[str, bytes]:
    """Return the same of a proxy of the FMU with the file name `original`.

    `own` are the files that only this proxy has: its variables, the wire with its signature.
    """
    included = (
        f'#define PROXY_ORIGINAL {string(original)}\n\n#include "wire.h"\n#include "variables.h"'
    )
    main = _MAIN.format(
        name=name, fmi=fmi, guid=guid, how=_PROXY, defined=_SYSTEM, included=included
    )
    return {
        f"{name}.c": main.encode(),
        **{file: text.encode() for file, text in own.items()},
        **_files(*PROXY, fmi=fmi),
    }


def _files(*names: str, fmi: Literal[2, 3]) -> dict[str, bytes]:
    """Return files that are the same in every FMU, and those of every slave."""
    files = [C / file for file in (*COMMON, *names, f"fmi{fmi}.h")]
    files += [C / "headers" / file for file in HEADERS[fmi]]
    return {file.name: file.read_bytes() for file in files}
