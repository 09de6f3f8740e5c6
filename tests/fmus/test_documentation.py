"""The page, the licences and the icon that every FMU holds."""

import re
import struct
import zipfile
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
from grasp_fmus import documentation
from grasp_fmus.contract import Field, declared
from grasp_fmus.documentation import PROXY, icon, licences, page
from grasp_fmus.fmu import build_fmu
from grasp_fmus.shipped import SCRIPTS, blocks
from report.javascript import in_browser

ROOT = Path(__file__).parents[2]

BLOCKS = blocks()
ICONS = sorted(file.stem for file in documentation.ICONS.glob("*.png"))
SECTIONS = {
    "How the host must find Python": [
        "inside the binary of pythonfmu", "64 bit", "Python 3.11 or newer", "a Python process",
        "nothing", "LD_PRELOAD=libpython3.x.so.1.0", "grasp-cosim build --bind-python",
        "PYTHONHOME", "python3.dll", "python3x.dll", "PATH", "No packages need to be installed",
        "ASCII letters, digits, _ . - ~ and spaces", "ASCII", "grasp-cosim doctor {name}.fmu",
    ],
    "Errors": [
        "On Windows it returns fmi2Fatal", "has no effect", "even when debug logging is off",
        "instance, time, variable, value and the allowed range", "not be finite", "fmi2Discard",
    ],
    "State": [
        "Getting, setting, freeing and serialising", "instances of the same FMU", "check sum",
    ],
    "Licence": ["MIT", "licenses/license.txt", "licenses/pythonfmu.txt"],
}  # fmt: skip


@pytest.fixture(scope="module", params=sorted(BLOCKS))
def name(request: pytest.FixtureRequest) -> str:
    """The FMUs, one after the other."""
    return str(request.param)


@pytest.fixture(scope="module")
def html(name: str) -> str:
    """The page of an FMU, from its card in the repository."""
    card = folder(BLOCKS[name]).joinpath("README.md").read_text("utf-8")
    return page(name, "A summary", card, "1.2.3")


def parsed(html: str) -> ElementTree.Element:
    """The page as XML: stricter than any reader of HTML."""
    return ElementTree.fromstring(html)


def text(element: ElementTree.Element) -> str:
    return " ".join("".join(element.itertext()).split())


def sections(html: str) -> dict[str, str]:
    """The text under each heading of the second level."""
    found: dict[str, str] = {}
    title = ""
    for element in parsed(html).iterfind("body/*"):
        if element.tag == "h2":
            title = text(element)
        found[title] = f"{found.get(title, '')} {text(element)}"
    return found


def links(html: str) -> list[str]:
    return [
        element.attrib[attribute]
        for element in parsed(html).iter()
        for attribute in ("href", "src")
        if attribute in element.attrib
    ]


def rendered(markdown: str) -> str:
    """What a card comes out as: what lies between the head of the page and its first section."""
    html = page("Name", "Summary", markdown, "1.2.3")
    return html.partition("grasp-cosim 1.2.3.</p>\n")[2].partition("<h2>How the host")[0].strip()


def test_the_page_is_well_formed_and_says_what_it_is(html: str, name: str) -> None:
    root = parsed(html)
    assert html.startswith("<!DOCTYPE html>\n")
    assert root.tag == "html"
    assert [child.tag for child in root] == ["head", "body"]
    assert [text(e) for e in root.iter("title")] == [text(e) for e in root.iter("h1")] == [name]
    assert {e.get("charset") for e in root.iter("meta")} == {"utf-8", None}
    assert "A summary." in text(root)
    assert "grasp-cosim 1.2.3." in text(root)


def test_every_variable_is_in_the_table(html: str, name: str) -> None:
    fields = declared(BLOCKS[name])
    rows = [[text(cell) for cell in row] for row in parsed(html).iter("tr")]
    described = {row[0]: row for row in rows if len(row) == 7}
    for f in fields:
        row = described[shown(f)]
        assert f.causality in row[1]
        assert row[2] == f.unit
        assert row[6] == f.description
    assert set(described) == {"variable", *variables_of(folder(BLOCKS[name]))}


def shown(f: Field) -> str:
    return ".".join(f.path) + (f"[1..{f.size}]" if f.size else "")


def folder(block: Any) -> Path:
    """Where its card lies."""
    return Path(block.__file__).parents[1]


def variables_of(card: Path) -> set[str]:
    """Of all FMUs that share a card."""
    sharing = [block for block in BLOCKS.values() if folder(block) == card]
    return {shown(f) for block in sharing for f in declared(block)}


def test_the_equations_are_set(html: str, name: str) -> None:
    card = folder(BLOCKS[name]).joinpath("README.md").read_text("utf-8")
    equations = re.findall(r"^```math\n(.*)\n```$", card, re.MULTILINE)
    divs = [e for e in parsed(html).iter("div") if e.get("class") == "equation"]
    assert len(divs) == len(equations) > 0
    for equation, div in zip(equations, divs, strict=True):
        math = div.find("div/math")
        assert math is not None
        assert math.get("display") == "block"
        assert "\\" not in text(math)
        tag = re.search(r"\\tag\{(.*)\}", equation)
        assert [text(e) for e in div.findall("span")] == ([f"({tag[1]})"] if tag else [])
    assert "```" not in html


def test_an_equation_comes_out_as_mathml() -> None:
    html = rendered("```math\n\\xi = \\frac{K}{l^n} \\tag{9}\n```")
    assert html == (
        '<div class="equation"><div><math display="block"><mrow><mi>&#x003BE;</mi>'
        "<mo>&#x0003D;</mo><mfrac><mrow><mi>K</mi></mrow><mrow><msup><mi>l</mi><mi>n</mi></msup>"
        "</mrow></mfrac></mrow></math></div><span>(9)</span></div>"
    )
    assert rendered("```sh\nrun\n```").startswith("<pre><code")


def test_a_cell_of_a_table_knows_its_head() -> None:
    html = rendered("| a | b |\n|---|---|\n| 1 | 2 |\n| 3 | 4 |\n\n| c |\n|---|\n| 5 |\n")
    cells = [(e.get("data-head"), text(e)) for e in parsed(f"<p>{html}</p>").iter("td")]
    assert cells == [("a", "1"), ("b", "2"), ("a", "3"), ("b", "4"), ("c", "5")]


@pytest.mark.slow
@pytest.mark.parametrize("size", [(360, 800), (1200, 800)])
@pytest.mark.parametrize("block", ["GraspController", "GripperPlant", "ProximitySensor"])
def test_nothing_sticks_out_of_the_page(block: str, size: tuple[int, int], tmp_path: Path) -> None:
    """Of an equation that is too long for a phone the rest is reached within its own line."""
    card = folder(BLOCKS[block]).joinpath("README.md").read_text("utf-8")
    html = page(block, "A summary", card, "1.2.3")
    ready = "<script>document.documentElement.dataset.ready = 1; const recording = {};</script>"
    act = """
      const box = (e) => e.getBoundingClientRect(), all = [...document.querySelectorAll("body *")];
      const beyond = all.filter((e) => !e.closest(".equation, pre") && box(e).right > innerWidth);
      return [document.documentElement.scrollWidth - innerWidth, beyond.map((e) => e.tagName)];
    """
    assert in_browser(html.replace("</head>", f"{ready}</head>"), act, tmp_path, size=size) == [
        0,
        [],
    ]


@pytest.mark.parametrize("title", SECTIONS)
def test_a_section_says_what_a_user_must_know(html: str, name: str, title: str) -> None:
    section = sections(html)[title]
    for fact in SECTIONS[title]:
        assert fact.format(name=name) in section


def test_the_way_out_of_python_is_named_where_there_is_one() -> None:
    assert "grasp-cosim build --native" in page("Name", "Summary", "", "1.2.3")
    assert "--native" not in page("Name", "Summary", "", "1.2.3", requires=["mujoco"])
    assert "grasp-cosim proxy --native" in page("Name", "Summary", "", "1.2.3", making=PROXY)


def test_the_sections_follow_the_card(html: str) -> None:
    assert list(sections(html))[-4:] == list(SECTIONS)


def test_the_page_stands_alone(html: str) -> None:
    root = parsed(html)
    assert not {e.tag for e in root.iter()} & {"script", "link", "iframe", "img", "object"}
    assert not [a for e in root.iter() for a in e.attrib if a.startswith("on")]
    assert "http" not in html
    assert "url(" not in html
    assert "@import" not in html
    assert str(ROOT) not in html
    assert "<!--" not in html
    assert "&lt;!--" not in html
    assert set(links(html)) == {f"licenses/{file}" for file in licences()}


@pytest.mark.parametrize(
    ("requires", "said"),
    [
        (("one",), "package one; python -m pip install 'grasp-cosim[one]'"),
        (("one", "two"), "packages one and two; python -m pip install 'grasp-cosim[one,two]'"),
        (("a", "b", "c"), "packages a, b and c; python -m pip install 'grasp-cosim[a,b,c]'"),
    ],
)
def test_packages_that_the_host_must_have_are_named(requires: tuple[str, ...], said: str) -> None:
    html = page("Name", "Summary", "", "1.2.3", requires=requires)
    section = sections(html)["How the host must find Python"]
    assert f"That Python must have the {said} installs it." in section
    assert "No packages" not in section


def test_headings_go_down_a_level() -> None:
    assert rendered("# One\n\n## Two") == "<h2>One</h2>\n<h3>Two</h3>"
    assert rendered("###### Six") == "<h6>Six</h6>"


def test_links_and_pictures_of_a_card_come_out_as_their_text() -> None:
    assert rendered("see [*the* plant](../plant/README.md)") == "<p>see <em>the</em> plant</p>"
    assert rendered("a ![contact <1>](../docs/a.png)") == "<p>a contact &lt;1&gt;</p>"


def test_html_in_a_card_is_text_and_its_marks_vanish() -> None:
    assert rendered("a <b>c</b> & d") == "<p>a &lt;b&gt;c&lt;/b&gt; &amp; d</p>"
    table = rendered("<!-- variables -->\n| a |\n|---|\n| b |\n<!-- end of variables -->\n")
    assert table.startswith("<h3>Variables</h3>\n<table>")
    assert table.endswith("</table>")


def test_name_summary_and_version_are_text() -> None:
    html = page("A<b", "c & d.", "", "<1>")
    assert [text(e) for e in parsed(html).iter("h1")] == ["A<b"]
    assert "c & d." in text(parsed(html))
    assert "grasp-cosim <1>." in text(parsed(html))


def test_licences_are_those_of_the_distributions() -> None:
    found = licences()
    assert list(found) == ["license.txt", "pythonfmu.txt"]
    assert found["license.txt"].decode() == (ROOT / "LICENSE").read_text("utf-8")
    theirs = metadata.distribution("pythonfmu").locate_file(
        f"pythonfmu-{metadata.version('pythonfmu')}.dist-info/licenses/LICENSE"
    )
    assert found["pythonfmu.txt"].decode() == Path(str(theirs)).read_text("utf-8")
    assert all(b"Permission is hereby granted, free of charge" in text for text in found.values())


def test_a_distribution_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documentation, "_LICENCES", {"license.txt": "no-such-distribution"})
    with pytest.raises(FileNotFoundError, match=r"^no-such-distribution: .*licenses/LICENSE.*pip$"):
        licences()


def test_a_missing_licence_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """The distribution's class may be that of a backport, which other packages bring along."""
    bare = SimpleNamespace(read_text=lambda name: None)
    monkeypatch.setattr(metadata, "distribution", lambda name: bare)
    with pytest.raises(FileNotFoundError, match=r"^grasp-cosim: .*licenses/LICENSE.*pip$"):
        licences()


@pytest.mark.parametrize("name", ICONS)
def test_the_icon_is_a_small_picture_with_a_transparent_background(name: str) -> None:
    png = icon(name) or b""
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    length, kind, width, height, depth, color = struct.unpack(">I4sIIBB", png[8:26])
    assert (length, kind, width, height, depth) == (13, b"IHDR", 256, 256, 8)
    assert color == 6  # red, green, blue and alpha
    assert len(png) < 10_000
    assert b"tEXt" not in png  # neither program nor date


def test_icons_differ_and_each_is_of_an_fmu_or_of_proxies() -> None:
    files = list(documentation.ICONS.iterdir())
    assert {*BLOCKS, "Proxy"} == set(ICONS)
    assert len({file.read_bytes() for file in files}) == len(files)


def test_an_fmu_need_not_have_an_icon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documentation, "ICONS", tmp_path)
    assert icon("GripperPlant") is None
    built = build_fmu(SCRIPTS / "GripperPlant.py", tmp_path)
    with zipfile.ZipFile(built.path) as archive:
        assert "model.png" not in archive.namelist()


def test_the_fmu_holds_page_licences_and_icon(fmus: Path, name: str) -> None:
    with zipfile.ZipFile(fmus / f"{name}.fmu") as archive:
        html = archive.read("documentation/index.html").decode()
        assert links(html)
        for link in links(html):
            assert archive.read(f"documentation/{link}") == licences()[Path(link).name]
        if name in ICONS:
            assert archive.read("model.png") == icon(name)


def test_a_bound_fmu_says_what_it_is_bound_to() -> None:
    library = Path("/opt/libpython3.11.so.1.0")
    bound = page("Name", "A summary.", "# Card\n", "1.2.3", library)
    assert f"Nothing where there is {library}, to which this FMU is bound" in text(parsed(bound))
    assert "LD_PRELOAD" not in bound
    assert "LD_PRELOAD" in page("Name", "A summary.", "# Card\n", "1.2.3")


def test_the_page_of_a_proxy_says_what_is_different() -> None:
    html = page("Name", "A summary.", "# Card\n", "1.2.3", making=PROXY)
    found = sections(html)
    assert "grasp-cosim proxy --bind-python" in found["How the host must find Python"]
    assert "fmi2Discard" not in found["Errors"]
    assert "returns fmi2OK: proxy.state says what became of it" in found["Errors"]
    assert found["State"] == " State Not supported: the state is that of the peer."
