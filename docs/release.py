"""Makes the files of a release in dist/: make dist. The same sources give the same bytes.

They are the wheel, the sdist, the FMUs in Python and as C for every platform, and the SSP archives.
The playground, SHA256SUMS and index.html with a description of each file come with them.
zig (in the extra native) compiles for all platforms, so that none of it depends on the machine. It
takes a few minutes the first time, mostly for zig's own libraries of Windows, and shows progress.
"""

import hashlib
import logging
import re
import shutil
import sys
import time
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

FOLDERS = (*NATIVE, "python")
"""Those of FMUs."""

OF_SOURCES = re.compile(r"## Get a release\n.*?(?=^## )", re.DOTALL | re.MULTILINE)
OF_THE_SOURCES = "Pages in brackets are in the sources, the `.tar.gz`.\n\n"
"""In the place of the section on releases, for those who have the release."""

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
<h3>For the cross-check</h3>
<p>Next to each FMU are the inputs that it can be tried with (<code>NAME_in.csv</code>), the results
that are right for them (<code>NAME_ref.csv</code>) and the options of such a run
(<code>NAME_ref.opt</code>), as the rules of the FMI cross-check have them.</p>
$cross_checks
<h2 id="ssp">The archives</h2>
<p>$archives</p>
$more
</html>
""")


def write_release(out: Path) -> list[Path]:
    """Write all files of a release into the empty folder `out`; returns them in order."""
    out.mkdir(parents=True)
    for name in (build_wheel(str(out)), build_sdist(str(out))):
        tell(f"{name}: written")
    tell("the first library for Windows takes minutes, as zig makes its own before, once")
    for folder, (fmi, names) in NATIVE.items():
        tell(f"{folder}: FMUs as C, FMI {fmi}.0, for {', '.join(names)}")
        build_native(out / folder, planned(targets(names), fmi))
    tell("python: the FMUs that Python runs")
    build(out / "python")
    for name, system in systems(out / "fmi2"):
        tell(f"ssp: {name}")
        (out / "ssp").mkdir(exist_ok=True)
        write_ssp(system, out / "ssp" / name)
    shutil.copyfile(ROOT / "docs/playground.html", out / "playground.html")
    files = sorted(path for path in out.rglob("*") if path.is_file())
    sums = (f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {_in(out, path)}" for path in files)
    write_text(out / "SHA256SUMS", "".join(f"{line}\n" for line in sums))
    write_text(out / "index.html", page(out))
    tell(f"{len(files) + 2} files, in {out}")
    return [*files, out / "SHA256SUMS", out / "index.html"]


def tell(line: str) -> None:
    """Print a line, with the time since the start in s."""
    print(f"{time.perf_counter() - START:4.0f} s  {line}", file=sys.stderr, flush=True)


class Told(logging.Handler):
    """Tells what is logged: each library that was compiled."""

    def emit(self, record: logging.LogRecord) -> None:
        """Tell the message."""
        tell(f"  {record.getMessage()}")


START = time.perf_counter()


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
    """The page that says what each file is, and links to it."""
    version = next(out.glob("*.whl")).name.split("-")[1]
    rows = (
        f"<tr><td>{_link(out, path)}<td>{text}"
        for pattern, text in WHAT.items()
        for path in sorted(out.glob(pattern))
    )
    return PAGE.substitute(
        version=version,
        rows="\n".join(rows),
        fmus="\n".join(_fmus(out)),
        cross_checks="\n".join(_cross_checks(out)),
        archives=", ".join(_link(out, path) for path in sorted((out / "ssp").iterdir())),
        more=into_your_tool(),
    )


def _fmus(out: Path) -> Iterator[str]:
    """The rows of a table of all FMUs, with a column for each folder."""
    heads = "".join(f'<th id="{folder}">{folder}' for folder in FOLDERS)
    yield f"<tr><th>{heads}<th>"
    for path in sorted((out / "fmi2").glob("*.fmu")):
        model = read_model_description(path)
        links = (_link(out, out / folder / path.name, "FMU") for folder in FOLDERS)
        cells = "".join(f"<td>{link}" for link in links)
        yield f"<tr><td>{model.modelName}{cells}<td>{model.description}"


def _cross_checks(out: Path) -> Iterator[str]:
    """The files next to the FMUs of each folder."""
    for folder in FOLDERS:
        files = sorted(path for path in (out / folder).iterdir() if path.suffix != ".fmu")
        links = ", ".join(_link(out, path, path.name) for path in files)
        yield f"<details><summary>{folder}, {len(files)} files</summary><p>{links}</p></details>"


def _link(out: Path, path: Path, text: str = "") -> str:
    """A link to a file, or to the section of the page on the files of a folder."""
    place = _in(out, path)
    return f'<a href="{"#" if path.is_dir() else ""}{place}">{text or place}</a>'


def into_your_tool() -> str:
    """That page as HTML; of pages that it links to, which are in the sources, it says so."""
    text = (ROOT / "docs/how_to/your_tool.md").read_text("utf-8")
    text = OF_SOURCES.sub(OF_THE_SOURCES, re.sub("^#", "##", text, count=1))
    alone = re.sub(r"\[([^]]*)\]\(([^)#]*)[^)]*\)", _in_the_sources, text)
    return str(MarkdownIt().enable("table").render(alone))


def _in_the_sources(link: re.Match[str]) -> str:
    path = (ROOT / "docs/how_to" / link[2]).resolve().relative_to(ROOT)
    return f"{link[1]} (`{path.as_posix()}`)"


def _in(out: Path, path: Path) -> str:
    return path.relative_to(out).as_posix()


if __name__ == "__main__":
    folder = Path(*sys.argv[1:]) if sys.argv[1:] else ROOT / "dist"
    if folder.exists():
        shutil.rmtree(folder)
    logging.getLogger("grasp_cosim.base.c_compilers").setLevel(logging.INFO)
    logging.getLogger("grasp_cosim.base.c_compilers").addHandler(Told())
    for written in write_release(folder):
        print(written)
