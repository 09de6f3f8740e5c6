"""The page, the licences and the icon that every FMU holds."""

import re
import struct
from pathlib import Path
from xml.etree import ElementTree

import pytest
from grasp_cosim.fmu_export import page as made
from grasp_cosim.fmu_export.build import build_model
from grasp_cosim.fmu_export.contract import declared
from grasp_cosim.fmu_export.description import version
from grasp_cosim.fmu_export.package import shipped_model
from grasp_cosim.fmu_export.page import NATIVE, PROXY, PYTHON, icon, needed, page
from grasp_cosim.fmu_export.shipped import blocks
from report.javascript import in_browser
from support.fmi2 import read_members

ROOT = Path(__file__).parents[2]

BLOCKS = blocks()
ICONS = sorted(file.stem for file in made.ICONS.glob("*.png"))
KINDS = {"Python": PYTHON, "native": NATIVE, "proxy": PROXY}


def card(block):
    return Path(block.__file__).parents[1] / "README.md"


def of(name):
    """The page of one of our FMUs."""
    return page(name, "A summary", card(BLOCKS[name]).read_text("utf-8"), PYTHON)


def text(element):
    return " ".join("".join(element.itertext()).split())


def rendered(markdown):
    """What a card comes out as: what lies between the head of the page and its first section."""
    html = page("Name", "Summary", markdown, PYTHON)
    own = html.partition(f"grasp-cosim {version()}.</p>\n")[2]
    return own.partition("<h2>What the host")[0].strip()


@pytest.mark.parametrize("name", BLOCKS)
def test_the_page_is_well_formed_complete_and_stands_alone(name):
    html = of(name)
    root = ElementTree.fromstring(html)
    assert html.startswith("<!DOCTYPE html>\n")
    assert [text(e) for e in root.iter("title")] == [text(e) for e in root.iter("h1")] == [name]
    cells = [[text(cell) for cell in row] for row in root.iter("tr")]
    rows = [(row[0], row[1].split()[-1], row[2], row[6]) for row in cells if len(row) == 7]
    for f in declared(BLOCKS[name]):
        assert (shown(f), f.causality, f.unit, f.description) in rows
    equations = re.findall(r"^```math$", card(BLOCKS[name]).read_text("utf-8"), re.MULTILINE)
    assert [e.get("class") for e in root.iter("div")].count("equation") == len(equations) > 0
    assert not {e.tag for e in root.iter()} & {"script", "link", "iframe", "img", "object", "a"}
    for foreign in ("http", "url(", "@import", str(ROOT), "<!--", "&lt;!--", "```", "$"):
        assert foreign not in html


def shown(f):
    return f.name + (f"[1..{f.size}]" if f.size else "")


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("Python", ["a Python process", "fmi2Fatal", "debug logging is on", "build --native"]),
        ("native", ["needs no Python", "-DFMI3_OVERRIDE_FUNCTION_PREFIX", "fmi3Discard", "Name_"]),
        ("proxy", ["a peer in reach", "fmi3OK", "the state is that of the peer", "ws2_32"]),
    ],
)
def test_a_page_says_what_is_to_be_said_of_its_kind(kind, said):
    html = text(ElementTree.fromstring(page("Name", "Summary", "", KINDS[kind], 3)))
    for words in said:
        assert words in html
    assert ("pythonfmu.txt" in html) == (kind == "Python")


def test_packages_that_the_host_must_have_are_named():
    html = page("A<b", "c & d.", "", PYTHON, packages=needed(["one", "two"]))
    assert "That Python must have <code>one</code>, <code>two</code>." in html
    assert "<h1>A&lt;b</h1>\n<p>c &amp; d.</p>" in html
    assert needed([]) == "No packages need to be installed."


@pytest.mark.parametrize(
    ("markdown", "html"),
    [
        ("# One\n\n## Two", "<h2>One</h2>\n<h3>Two</h3>"),
        ("###### Six", "<h6>Six</h6>"),
        ("see [*the* plant](../plant/README.md)", "<p>see <em>the</em> plant</p>"),
        ("a ![contact <1>](../docs/a.png)", "<p>a contact &lt;1&gt;</p>"),
        ("a <b>c</b> & d", "<p>a &lt;b&gt;c&lt;/b&gt; &amp; d</p>"),
        ("<!-- variables -->\nx\n<!-- end of variables -->", "<h3>Variables</h3>\n<p>x</p>"),
        ("```sh\nrun\n```", '<pre><code class="language-sh">run\n</code></pre>'),
        (
            "```math\n\\xi = \\frac{K}{l^n} \\tag{9}\n```",
            '<div class="equation"><div><math display="block"><mrow><mi>&#x003BE;</mi><mo>&#x0003D;'
            "</mo><mfrac><mrow><mi>K</mi></mrow><mrow><msup><mi>l</mi><mi>n</mi></msup></mrow>"
            "</mfrac></mrow></math></div><span>(9)</span></div>",
        ),
        (
            "the mass $m_j$",
            '<p>the mass <math display="inline"><mrow><msub><mi>m</mi><mi>j</mi></msub></mrow>'
            "</math></p>",
        ),
        ("`$m$`, 5 $ or $$", "<p><code>$m$</code>, 5 $ or $$</p>"),
    ],
)
def test_what_a_card_comes_out_as(markdown, html):
    assert rendered(markdown) == html


def test_a_cell_of_a_table_knows_its_head():
    html = rendered("| a | b |\n|---|---|\n| 1 | 2 |\n| 3 | 4 |\n\n| c |\n|---|\n| 5 |\n")
    cells = [
        (e.get("data-head"), text(e)) for e in ElementTree.fromstring(f"<p>{html}</p>").iter("td")
    ]
    assert cells == [("a", "1"), ("b", "2"), ("a", "3"), ("b", "4"), ("c", "5")]


@pytest.mark.slow
@pytest.mark.parametrize("size", [(360, 800), (1200, 800)])
@pytest.mark.parametrize("block", ["GraspController", "GripperPlant", "ProximitySensor"])
def test_nothing_sticks_out_of_the_page(block, size, tmp_path):
    """Of an equation that is too long for a phone the rest is reached within its own line."""
    ready = "<script>document.documentElement.dataset.ready = 1; const recording = {};</script>"
    act = """
      const box = (e) => e.getBoundingClientRect(), all = [...document.querySelectorAll("body *")];
      const beyond = all.filter((e) => !e.closest(".equation, pre") && box(e).right > innerWidth);
      return [document.documentElement.scrollWidth - innerWidth, beyond.map((e) => e.tagName)];
    """
    html = of(block).replace("</head>", f"{ready}</head>")
    assert in_browser(html, act, tmp_path, size=size) == [0, []]


def test_icons_are_small_pictures_with_a_transparent_background():
    assert {*BLOCKS, "Proxy"} == set(ICONS)
    for name in ICONS:
        png = icon(name) or b""
        size = struct.unpack(">I4sIIBB", png[8:26])
        assert (png[:8], size) == (b"\x89PNG\r\n\x1a\n", (13, b"IHDR", 256, 256, 8, 6))
        assert len(png) < 10_000
        assert b"tEXt" not in png  # neither program nor date
    assert len({icon(name) for name in ICONS}) == len(ICONS)


def test_the_fmu_holds_page_licences_and_icon(fmus, tmp_path, monkeypatch):
    files = read_members(fmus / "GripperPlant.fmu")
    assert files["documentation/index.html"].startswith(b"<!DOCTYPE html>")
    of_both = [files[f"documentation/licenses/{name}.txt"] for name in ("license", "pythonfmu")]
    assert of_both[0] == (ROOT / "LICENSE").read_bytes()
    assert all(b"Permission is hereby granted, free of charge" in text for text in of_both)
    assert files["model.png"] == icon("GripperPlant")
    monkeypatch.setattr(made, "ICONS", tmp_path)  # it need not have one
    assert "model.png" not in read_members(
        build_model(shipped_model("GripperPlant"), tmp_path).path
    )
