"""Compiles a Modelica model to an FMU, by rumoca 0.9.13 and a C compiler.

    python docs/modelica_fmu.py modelica/GraspCosim GraspCosim.Plant -o plant.fmu [--fmi 3]

It runs in an environment with rumoca 0.9.13 and needs nothing of grasp-cosim. rumoca writes the
model description and the C code. This script mends three faults of the description, compiles the
code for this computer and packs all of it. docs/how_to/modelica.md describes the limits of rumoca.
"""

import argparse
import os
import platform
import re
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

COMPILER_TIMEOUT = 300
"""s."""

START = re.compile(r' start="[^"]*"')
ELEMENT = re.compile(r'name="[^"]*\[(\d+)\]"[^>]*>\s*<\w+ start="(\[[^"]*\])"')
NEGATIVE = re.compile(r"\((-[^()]*)\)")
UNIT = re.compile(r' unit="([^"]*)"')


class CompileError(Exception):
    """The model is not compiled, for the reason that the message states in one line."""


def sources(library: Path, model: str, fmi: int) -> dict[str, str]:
    """The files that rumoca writes for a model, by their path in the FMU.

    Args:
        library: The folder of a package, or a .mo file.
        model: The full name of the model, such as GraspCosim.Plant.
        fmi: 2 or 3.

    Raises:
        CompileError: rumoca is missing, writes no FMUs, or refuses the model.
    """
    try:
        import rumoca
    except ModuleNotFoundError:
        raise CompileError("rumoca is not installed: pip install rumoca==0.9.13") from None
    file = library / "package.mo" if library.is_dir() else library
    if not file.is_file():
        raise CompileError(f"{file}: no such file; must be a package or a .mo file")
    folder = file.parent.parent if file.name == "package.mo" else file.parent
    try:
        session = rumoca.Session([str(folder.resolve())])
        rendered = session.load(str(file.resolve()), model=model).codegen(f"fmi{fmi}")
    except (rumoca.RumocaError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise CompileError(f"{model}: rumoca {rumoca.version()}: {reason}") from None
    return {found.path: found.content for found in rendered.files}


def mended(description: str) -> str:
    """A model description of rumoca as the standard has it.

    rumoca has three faults. In FMI 2.0 the element of a vector has the start of the whole vector.
    Negative numbers are between parentheses, and no unit is defined.
    """
    description = START.sub(lambda start: NEGATIVE.sub(r"\1", start[0]), description)
    description = ELEMENT.sub(_of_the_element, description)
    units = sorted({*UNIT.findall(description)})
    defined = "".join(f'<Unit name="{unit}"/>' for unit in units)
    definitions = f"<UnitDefinitions>{defined}</UnitDefinitions>\n  " if units else ""
    return description.replace("<LogCategories>", f"{definitions}<LogCategories>", 1)


def _of_the_element(declaration: re.Match[str]) -> str:
    """The declaration with the start of its element."""
    starts = declaration[2].strip("[]").split(",")
    return declaration[0].replace(declaration[2], starts[int(declaration[1]) - 1].strip())


def write_fmu(files: dict[str, str], fmi: int, fmu: Path) -> None:
    """Compile the C code of `files` for this computer, and write all into `fmu`.

    Raises:
        CompileError: the C compiler is missing, or refuses the code.
    """
    machine = "linux64" if fmi == 2 else f"{platform.machine()}-linux"
    (source,) = (path for path in files if path.endswith(".c"))
    with TemporaryDirectory(dir=fmu.resolve().parent) as temporary:
        folder = Path(temporary, "fmu")
        for path, text in files.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text, "utf-8")
        binary = folder / "binaries" / machine / f"{Path(source).stem}.so"
        binary.parent.mkdir(parents=True)
        _compile(folder / source, binary)
        packed = Path(temporary, fmu.name)
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(folder.rglob("*")):
                archive.write(file, file.relative_to(folder))
        packed.replace(fmu)


def _compile(source: Path, binary: Path) -> None:
    compiler = os.environ.get("CC", "cc")
    command = [compiler, "-shared", "-fPIC", "-O2", "-o", str(binary), str(source), "-lm"]
    try:
        done = subprocess.run(  # noqa: S603
            command, capture_output=True, text=True, timeout=COMPILER_TIMEOUT, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise CompileError(f"{compiler}: {error}; CC may name another C compiler") from None
    if done.returncode:
        faults = [line for line in done.stderr.splitlines() if "error" in line]
        raise CompileError(f"{source.name}: {compiler} refuses it: {''.join(faults[:1])}")


def main(arguments: Sequence[str]) -> int:
    """Compile what the arguments name; the exit code is 2 if that is not possible."""
    parser = argparse.ArgumentParser(description="Compile a Modelica model to an FMU.")
    parser.add_argument("library", type=Path, help="folder of a package, or a .mo file")
    parser.add_argument("model", help="full name, such as GraspCosim.Plant")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the FMU to write")
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI")
    given = parser.parse_args(arguments)
    try:
        files = sources(given.library, given.model, given.fmi)
        files["modelDescription.xml"] = mended(files["modelDescription.xml"])
        write_fmu(files, given.fmi, given.output)
    except (CompileError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{given.output}: written, FMI {given.fmi}.0")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
