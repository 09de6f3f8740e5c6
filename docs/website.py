"""Makes the site of all pages, of the commands and of the Python interface, by Sphinx: make docs.

    .venv/bin/python docs/website.py [FOLDER]     # by default results/site; begin with index.html

docs/README.md lists the pages in their groups: it is the navigation. The pages stay where they
belong in the checkout. They are copied into a temporary folder, together with the files that they
link to. Sphinx was chosen because its search works from a file, and because it documents click
commands and Python functions: MkDocs 1 with Material is no longer developed, and Zensical, which
follows it, has no pages of click yet. Each warning of Sphinx is an error.
"""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import grasp_cosim
from grasp_cosim.cli.group import MODULE_OF_COMMAND

ROOT = Path(__file__).parents[1]
MAP = Path("docs/README.md")
"""The page that lists all others."""

ORCHESTRATOR = Path("orchestrator/README.md")
"""The page that has those of the packages below it."""

LINK = re.compile(r"\]\(([^)#\s:]+)(#[^)\s]*)?\)")
FENCED = re.compile(r"^(```|~~~).*?^\1", re.DOTALL | re.MULTILINE)

MODULES = (
    "grasp_cosim.master.simulation",
    "grasp_cosim.metrics.metric",
    "grasp_cosim.exchange.listener",
    "grasp_cosim.recording.csv",
    "grasp_cosim.recording.mdf",
    "grasp_cosim.sweeps.sweep",
    "grasp_cosim.gym.environment",
    "grasp_cosim.linearisation.state_space",
    "grasp_cosim.comparison.compare",
    "grasp_cosim.comparison.qualify",
    "grasp_cosim.comparison.bands",
)
"""Modules that users import, behind the names of `grasp_cosim` itself."""

COMMANDS, PYTHON = "docs/reference/commands", "docs/reference/python"
"""The folders of the pages that are generated."""


class Group(NamedTuple):
    """A group of pages in the navigation."""

    title: str
    pages: list[Path]


def groups() -> list[Group]:
    """The groups of docs/README.md with their pages, from the top of the checkout, in order."""
    found: list[Group] = []
    for line in (ROOT / MAP).read_text("utf-8").splitlines():
        if line.startswith("## "):
            found.append(Group(line[3:].strip(), []))
        elif found and line.startswith("- "):
            links = LINK.findall(line)
            found[-1].pages.extend(from_top(MAP, link) for link, _ in links)
    return found


def from_top(page: Path, link: str) -> Path:
    """The file that a link of a page leads to, from the top of the checkout."""
    return Path(os.path.normpath(page.parent / link))


def pages() -> list[Path]:
    """All pages: the README, the map, those of the groups and those below them."""
    listed = [Path("README.md"), MAP, *(page for group in groups() for page in group.pages)]
    return [*listed, *pages_of_packages()]


def pages_of_packages() -> list[Path]:
    """The pages of the packages, which the page of the orchestrator links to."""
    text = (ROOT / ORCHESTRATOR).read_text("utf-8")
    links = {from_top(ORCHESTRATOR, link) for link, _ in LINK.findall(text)}
    folder = ORCHESTRATOR.parent
    return sorted(p for p in links if p.name == "README.md" and p.is_relative_to(folder))


def copy(folder: Path) -> None:
    """Put the pages into a folder, with all that they link to, and the pages that are generated."""
    for page in pages():
        target = folder / ("index.md" if page == Path("README.md") else page)
        target.parent.mkdir(parents=True, exist_ok=True)
        if page.suffix != ".md":
            shutil.copyfile(ROOT / page, target)
            continue
        text = (ROOT / page).read_text("utf-8")
        for link, _ in LINK.findall(FENCED.sub("", text)):
            source = from_top(page, link)
            if (ROOT / source).is_file() and source.suffix not in (".md", ".ipynb"):
                (folder / source).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(ROOT / source, folder / source)
        target.write_text(f"{adapted(page, text)}{contents(page)}", "utf-8")
    for name, text in generated():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")


def adapted(page: Path, text: str) -> str:
    """The text of a page with links as the site has them.

    The README is the index of the site; a page of HTML is opened, where Sphinx would offer it for
    download; a folder is its README.
    """

    def link(match: re.Match[str]) -> str:
        source = from_top(page, match[1])
        anchor = match[2] or ""
        if source == Path("README.md"):
            return f"]({os.path.relpath('index.md', page.parent)}{anchor})"
        if (ROOT / source).is_dir():
            return f"]({match[1].rstrip('/')}/README.md{anchor})"
        return match[0]

    text = LINK.sub(link, text)
    opened = re.compile(r"(?<!!)\[([^]]*)\]\(([^)\s:]+\.html)(#[^)]*)?\)")
    return opened.sub(r'<a href="\2\3">\1</a>', text)


def contents(page: Path) -> str:
    """The hidden tables of contents that a page ends with: the navigation of the site."""
    if page == Path("README.md"):
        trees = [tree("", ["docs/README"])]
        for group in groups():
            names = [path.with_suffix("").as_posix() for path in group.pages]
            if group.title == "Reference":
                names += [f"{COMMANDS}/index", f"{PYTHON}/index"]
            trees.append(tree(group.title, names))
        return "".join(trees)
    if page == ORCHESTRATOR:
        paths = [path.with_suffix("") for path in pages_of_packages()]
        return tree("", [os.path.relpath(path, page.parent) for path in paths])
    return ""


def tree(title: str, names: list[str]) -> str:
    """A hidden table of contents."""
    caption = f":caption: {title}\n" if title else ""
    return "\n```{toctree}\n:hidden:\n" + caption + "\n" + "\n".join(names) + "\n```\n"


def generated() -> Iterator[tuple[str, str]]:
    """The pages of the commands and of the Python interface, by file name."""
    yield f"{COMMANDS}/index.md", command_index()
    for name, module in MODULE_OF_COMMAND.items():
        directive = f".. click:: grasp_cosim.cli.{module}:{name}\n   :prog: grasp-cosim {name}\n"
        codes = "All commands have the same [exit codes](../files_and_exit_codes.md).\n"
        yield f"{COMMANDS}/{name}.md", f"{restructured(directive)}\n{codes}"
    yield f"{PYTHON}/index.md", python_index()
    for name in grasp_cosim.__all__:
        kind = "autoclass" if isinstance(getattr(grasp_cosim, name), type) else "autofunction"
        members = "   :members:\n   :member-order: bysource\n" if kind == "autoclass" else ""
        directive = f".. {kind}:: grasp_cosim.{name}\n{members}"
        yield f"{PYTHON}/{name}.md", f"# {name}\n\n{restructured(directive)}"
    for module in MODULES:
        directive = (
            f".. automodule:: {module}\n   :no-index:\n   :members:\n   :member-order: bysource\n"
        )
        title = module.removeprefix("grasp_cosim.")
        yield f"{PYTHON}/{module}.md", f"# {title}\n\n{restructured(directive)}"


def restructured(directive: str) -> str:
    """A directive that has to be written in reStructuredText, on a page of Markdown."""
    return f"```{{eval-rst}}\n{directive}```\n"


def command_index() -> str:
    """The page that lists all commands with their first sentences."""
    rows = []
    for name in MODULE_OF_COMMAND:
        module = import_module(f"grasp_cosim.cli.{MODULE_OF_COMMAND[name]}")
        purpose = getattr(module, name).get_short_help_str(200)
        rows.append(f"| [`{name}`]({name}.md) | {purpose} |\n")
    return (
        "# Commands\n\n`grasp-cosim COMMAND --help` prints the same text.\n\n"
        f"| command | purpose |\n|---|---|\n{''.join(rows)}{tree('', list(MODULE_OF_COMMAND))}"
    )


def python_index() -> str:
    """The page that lists all public names with the first sentences of their docstrings."""
    rows = []
    for name in grasp_cosim.__all__:
        first = (getattr(grasp_cosim, name).__doc__ or "").strip().splitlines()[0]
        rows.append(f"| [`{name}`]({name}.md) | {first} |\n")
    names = [*grasp_cosim.__all__, *MODULES]
    return (
        "# Python\n\nUsers import these names from `grasp_cosim`.\n\n"
        f"| name | purpose |\n|---|---|\n{''.join(rows)}\n"
        "## Modules\n\nFew users need more than the names above.\n\n"
        + "".join(f"- [`{module}`]({module}.md)\n" for module in MODULES)
        + tree("", names)
    )


def settings() -> Mapping[str, Any]:
    """The configuration of Sphinx."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    repository = project.get("urls", {}).get("Repository")
    return {
        "project": "grasp-cosim",
        "html_title": f"grasp-cosim {project['version']}",
        "extensions": [
            "myst_nb",
            "sphinx.ext.autodoc",
            "sphinx.ext.napoleon",
            "sphinx_click",
            "sphinx_copybutton",
            "website_extension",
        ],
        "nb_execution_mode": "off",
        "myst_enable_extensions": ["dollarmath"],
        "myst_fence_as_directive": ["math"],
        "myst_heading_anchors": 5,
        "suppress_warnings": ["myst.header"],  # equation sheets go from level 1 to 3
        "html_math_renderer": "mathml",
        "default_role": "code",
        "smartquotes": False,
        "autodoc_typehints": "description",
        "autodoc_typehints_description_target": "documented",
        "copybutton_prompt_text": r"\w*\$ |>>> |\.\.\. ",
        "copybutton_prompt_is_regexp": True,
        "html_theme": "furo",
        "html_theme_options": {"source_repository": repository} if repository else {},
        "html_static_path": [str(ROOT / "docs/website.css")],
        "html_css_files": ["website.css"],
        "html_copy_source": False,
        "pygments_style": "friendly",
    }


def configuration() -> str:
    """The text of conf.py, which Sphinx reads."""
    folder = str(Path(__file__).parent)
    lines = ["import sys", f"sys.path.insert(0, {folder!r})"]
    lines += [f"{name} = {value!r}" for name, value in settings().items()]
    return "\n".join(lines) + "\n"


def main(site: Path) -> None:
    """Write the site; SystemExit with the warnings of Sphinx if there are any."""
    with TemporaryDirectory(prefix="grasp_site_") as name:
        source = Path(name, "pages")
        source.mkdir()
        copy(source)
        (source / "conf.py").write_text(configuration(), "utf-8")
        command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
        command += ["-d", str(Path(name, "doctrees")), str(source), str(site.resolve())]
        done = subprocess.run(command, capture_output=True, text=True)  # noqa: S603
        if done.returncode:
            raise SystemExit(done.stderr)
    for page in ROOT.glob("docs/*.html"):
        shutil.copyfile(page, site / "docs" / page.name)
    print(site / "index.html")


if __name__ == "__main__":
    main(Path(*sys.argv[1:]) if sys.argv[1:] else ROOT / "results/site")
