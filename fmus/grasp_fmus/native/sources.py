"""Puts together the C sources of a native FMU: one file to compile, which includes the others."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

C = Path(__file__).with_name("c")
COMMON = ("python_arithmetic.h", "number_text.h", "blake2b.h", "slave.h")
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

   Compile as C99, without contraction (-ffp-contract=off) and never with -ffast-math: an FMU that
   would not calculate as its Python source does makes no instance and says why in the log. */

#if !defined(FMI{fmi}_FUNCTION_PREFIX) && !defined({name}_EXPORTS)
#define FMI{fmi}_FUNCTION_PREFIX {name}_
#endif

#if defined(_MSC_VER) && !defined(_CRT_SECURE_NO_WARNINGS)
#define _CRT_SECURE_NO_WARNINGS /* strcpy and strcat are given room for what they write */
#endif

#define TOKEN "{guid}"
#define CONTENT "{content}" /* of the FMU in Python with which states are exchanged */

#include "python_arithmetic.h"
#include "block.h"
#include "fmi{fmi}_interface.h"
"""


def native_sources(
    name: str, translation: Mapping[str, str], content: str, guid: str, fmi: Literal[2, 3]
) -> dict[str, bytes]:
    """Return the files of sources/ by name, for FMI `fmi`; NAME.c is the one to compile.

    `translation` is the block in C, by file name. `content` is the content hash of the FMU of the
    same block in Python, 16 hexadecimal digits, which is in states; `guid` is that of this FMU.
    """
    files = [C / file for file in (*COMMON, f"fmi{fmi}_interface.h")]
    files += [C / "headers" / file for file in HEADERS[fmi]]
    return {
        f"{name}.c": _MAIN.format(name=name, fmi=fmi, guid=guid, content=content).encode(),
        **{file: text.encode() for file, text in translation.items()},
        **{file.name: file.read_bytes() for file in files},
    }
