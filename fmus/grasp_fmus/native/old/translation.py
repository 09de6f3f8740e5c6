"""A block in C: the files of its modules, and block.h. The page: What a block may contain."""

from pathlib import Path
from typing import Any

from .block_header import block_header
from .layout import comment
from .program import Program
from .python_source import Sources, UntranslatableError

__all__ = ["UntranslatableError", "translated"]


def translated(name: str, block: Any, file: Path | None = None) -> dict[str, str]:
    """The C text of a block by file name: MODULE.h for each module, block.h.

    `file` is the source of a block module that has no __file__ of its own. UntranslatableError, one
    line, where the block has something that is not in the subset.
    """
    sources = Sources(block, file)
    own = sources.of(block.__name__)
    if own is None:
        raise UntranslatableError(f"{sources.block_file}: line 1: must be a Python file")
    program = Program(sources, block.Outputs)
    text, needed = block_header(program, name, block)
    files, stems = program.files(needed)
    homes = sorted({stems[program.items[key].home] for key in needed})
    includes = "".join(f'#include "{stem}.h"\n' for stem in homes)
    about = comment(f"{name}: the block as a slave calls it. Made from {own.file.name}.")
    files["block.h"] = (
        f"{about}#ifndef BLOCK_H\n#define BLOCK_H\n\n"
        f'#include "python_arithmetic.h"\n{includes}\n{text}\n#endif\n'
    )
    return files
