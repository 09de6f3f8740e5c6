"""Makes the files of a release in dist/: make dist. The same sources give the same bytes.

The wheel and the sdist, the FMUs in Python and as C for every platform, the grasps as SSP archives,
the playground, SHA256SUMS, and index.html, which says what each is. zig (in the extra native)
compiles for all platforms, so that none of it depends on the machine.
"""

import hashlib
import re
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from string import Template

from fmpy import read_model_description
from grasp_cosim import System, grasp_system, hand_system
from grasp_cosim.base.files import write_text
from grasp_cosim.fmu_export.build import build, build_native, planned
from grasp_cosim.fmu_export.native.targets import Version, targets
from grasp_cosim.ssp.to_archive import write_ssp
from hatchling.build import build_sdist, build_wheel
from markdown_it import MarkdownIt

ROOT = Path(__file__).parents[1]

NATIVE: dict[str, tuple[Version, Sequence[str]]] = {
    "fmi2": (2, ("linux64", "win64", "darwin64")),
    "fmi2-linux-arm": (2, ("aarch64-linux",)),
    "fmi3": (3, ("linux64", "win64", "darwin64", "aarch64-linux")),
}
"""The folders of FMUs as C, the version of FMI, and the platforms that their binaries are for."""

WHAT = {
    "fmi2": "FMUs as C, FMI 2.0, for Linux (x86-64), Windows and macOS: for Simulink, Dymola, "
    "OpenModelica and most other tools. They need neither Python nor a compiler; the sources are "
    "in them",
    "fmi2-linux-arm": "the same for Linux on ARM, as FMI 2.0 has one folder for both processors",
    "fmi3": "FMUs as C, FMI 3.0, for all of these platforms",
    "python": "the FMUs that Python runs: for hosts that are a Python process, such as FMPy",
    "ssp": "the grasps as SSP 1.0 archives with the FMUs of fmi2: for a tool that reads systems",
    "playground.html": "the grasp in a browser, without a network",
    "*.whl": "the command and the Python package: python -m pip install, Python 3.11 or newer",
    "*.tar.gz": "all sources, with tests and pages",
    "SHA256SUMS": "check sums: sha256sum -c SHA256SUMS",
}

PAGE = Template("""<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>grasp-cosim $version</title>
<style>
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; }
table { border-collapse: collapse; }
td, th { padding: 0.3em 1em 0.3em 0; vertical-align: top; text-align: left; }
td { border-top: 1px solid #8886; }
pre { overflow-x: auto; }
</style>
<h1>grasp-cosim $version</h1>
<table>
$rows
</table>
<h2>The FMUs</h2>
<table>
$fmus
</table>
$more
</html>
""")


def write_release(out: Path) -> list[Path]:
    """Write all files of a release into the empty folder `out`; returns them in order."""
    out.mkdir(parents=True)
    for name in (build_wheel(str(out)), build_sdist(str(out))):
        print(out / name)
    for folder, (fmi, names) in NATIVE.items():
        build_native(out / folder, planned(targets(names), fmi))
    build(out / "python")
    for name, system in systems(out / "fmi2"):
        (out / "ssp").mkdir(exist_ok=True)
        write_ssp(system, out / "ssp" / name)
    shutil.copyfile(ROOT / "docs/playground.html", out / "playground.html")
    files = sorted(path for path in out.rglob("*") if path.is_file())
    sums = (f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {_in(out, path)}" for path in files)
    write_text(out / "SHA256SUMS", "".join(f"{line}\n" for line in sums))
    write_text(out / "index.html", page(out))
    return [*files, out / "SHA256SUMS", out / "index.html"]


def systems(fmus: Path) -> Iterator[tuple[str, System]]:
    """The grasp under both laws, and a hand of three fingers, with the FMUs of a folder."""
    for name, system in (
        ("grasp.ssp", grasp_system(native=False)),
        ("grasp_adaptive.ssp", grasp_system("adaptive", native=False)),
        ("hand.ssp", hand_system(3, controller="adaptive", native=False)),
    ):
        for component in system.components:
            system = system.swap(component.name, fmus / component.fmu.name)
        yield name, system


def page(out: Path) -> str:
    """The page that says what each file is, with its size."""
    version = next(out.glob("*.whl")).name.split("-")[1]
    rows = (
        f'<tr><td><a href="{_in(out, path)}">{_in(out, path)}</a><td>{text}'
        for pattern, text in WHAT.items()
        for path in sorted(out.glob(pattern))
    )
    models = map(read_model_description, sorted((out / "fmi2").glob("*.fmu")))
    fmus = (f"<tr><td>{model.modelName}<td>{model.description}" for model in models)
    return PAGE.substitute(
        version=version, rows="\n".join(rows), fmus="\n".join(fmus), more=into_your_tool()
    )


def into_your_tool() -> str:
    """That page as HTML, without its links to other pages, which a release does not have."""
    text = (ROOT / "docs/into_your_tool.md").read_text("utf-8")
    alone = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text.replace("# Into", "## Into", 1))
    return str(MarkdownIt().enable("table").render(alone))


def _in(out: Path, path: Path) -> str:
    return path.relative_to(out).as_posix()


if __name__ == "__main__":
    folder = Path(*sys.argv[1:]) if sys.argv[1:] else ROOT / "dist"
    if folder.exists():
        shutil.rmtree(folder)
    for written in write_release(folder):
        print(written)
