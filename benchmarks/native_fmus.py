"""FMUs of the same shape as the grasp's, natively compiled: see native/lag.c.

Each takes over the whole model description, so that its ports, units and values are the same, and
has another binary. Needs gcc; the headers of FMI are those that FMPy brings along.
"""

import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy

SOURCE = Path(__file__).parent / "native" / "lag.c"
HEADERS = Path(fmpy.__file__).parent / "c-code"


def build_native(fmus: Path, out: Path) -> None:
    """The native counterparts of all FMUs in a folder. FileNotFoundError without gcc."""
    gcc = shutil.which("gcc")
    if gcc is None:
        raise FileNotFoundError("gcc: no such program; native FMUs need it")
    out.mkdir(parents=True, exist_ok=True)
    for fmu in sorted(fmus.glob("*.fmu")):
        description = fmpy.read_model_description(fmu)
        causalities = [v.causality for v in description.modelVariables]
        library = out / f"{fmu.stem}.so"
        macros = {
            "INPUTS": causalities.count("input"),
            "OUTPUTS": causalities.count("output"),
            "VARIABLES": len(causalities),
        }
        subprocess.run(
            [
                *(gcc, "-O2", "-shared", "-fPIC", "-I", str(HEADERS), "-o", str(library)),
                *(f"-D{name}={value}" for name, value in macros.items()),
                str(SOURCE),
            ],
            check=True,
        )
        with zipfile.ZipFile(out / fmu.name, "w") as archive, zipfile.ZipFile(fmu) as original:
            archive.writestr("modelDescription.xml", original.read("modelDescription.xml"))
            archive.write(library, f"binaries/linux64/{fmu.stem}.so")
