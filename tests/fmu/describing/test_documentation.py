"""What an FMU carries for people: terminals, icons, the page and the licences."""

import io
from dataclasses import replace
from html.parser import HTMLParser
from importlib.metadata import version
from pathlib import Path

import fmpy
import matplotlib.image
import numpy as np
import pytest
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from gantrytau_fmu.describing.documentation import MANY, documentation, licenses
from gantrytau_fmu.describing.terminals import SIZE, STROKES, icon, icon_svg, terminals_and_icons
from gantrytau_fmu.description import FmuVariable
from tests.fmu.interfaces import DESCRIPTIONS, VERSIONS, description, oscillator, said

ROOT = Path(__file__).parents[3]
SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"


class Page(HTMLParser):
    """The text, the tags and the cells of tables of a page."""

    def __init__(self, page: bytes):
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.rows: list[list[str]] = []
        self.words = ""
        self.cell = False
        self.feed(page.decode())

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.links += [value for name, value in attrs if name in ("href", "src") and value]
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        self.cell = tag in ("td", "th")

    def handle_endtag(self, tag):
        self.cell = False

    def handle_data(self, data):
        self.words += data
        if self.cell:
            self.rows[-1][-1] += data.strip("\n")

    def row(self, name):
        return next(row for row in self.rows if row and row[0] == name)


@pytest.mark.parametrize("name", DESCRIPTIONS)
def test_terminals_and_icons_follow_the_schema(name):
    text = terminals_and_icons(DESCRIPTIONS[name]())
    assert etree.XMLSchema(file=str(SCHEMA)).validate(etree.fromstring(text))


def test_members_of_terminals_are_what_can_be_connected():
    root = etree.fromstring(terminals_and_icons(oscillator()))
    assert root.get("fmiVersion") == "3.0"
    found = {
        terminal.get("name"): {
            m.get("memberName"): (m.get("variableName"), m.get("variableKind")) for m in terminal
        }
        for terminal in root.iterfind(".//Terminal")
    }
    # the speed is local: no importer could connect it; the terminal that has nothing else is not there
    assert found == {"flange": {"s": ("s", "signal"), "f": ("f", "signal")}}


def test_the_icon_is_a_small_picture_of_the_robot():
    pixels = matplotlib.image.imread(io.BytesIO(icon()), format="png")
    assert pixels.shape == (SIZE, SIZE, 4)
    assert (pixels[[0, 0, -1, -1], [0, -1, 0, -1], 3] == 0).all()  # corners are transparent
    for start, end, _, paint in (STROKES[0], STROKES[-1]):  # a rail at its end, the plate in its middle
        x, y = start if paint == STROKES[0][3] else np.add(start, end) / 2
        found = pixels[int(y * SIZE), int(x * SIZE)]
        np.testing.assert_allclose(found[:3] * 255, paint, atol=1)  # 8 bits
    assert len(icon()) < 2000
    assert len(etree.fromstring(icon_svg())) == len(STROKES)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_the_page_tells_inputs_outputs_parameters_and_states(fmi):
    page = Page(documentation(said(oscillator(), fmi)))
    assert page.row("f") == ["f", "N", "0.1", "-60 to 60", "force"]
    assert page.row("m") == ["m", "kg", "2.5", "≥ 0", "mass"]
    assert page.row("spring.c")[3:] == ["0 to 1000000", "stiffness; set before the start"]
    assert page.row("v")[:2] == ["v", "m/s"]  # a state
    assert page.row("share") == ["share", "1", "", "", "of the force in the spring"]
    for words in (
        f"{fmi}, Model Exchange and Co-Simulation",
        "A mass & a spring",
        "DOPRI5",
        "Mechanics_Box.fmu",
        "{a1}",
    ):
        assert words in page.words
    assert "States: 2; event indicators: 0." in page.words


def test_the_page_names_the_version_of_the_tool_and_what_is_marked():
    page = Page(documentation(oscillator()))
    assert page.row("Made with")[1] == f"gantrytau {version('gantrytau')}, 2026-01-02T03:04:05Z"
    assert page.row("spring.c")[4].endswith("set before the start")
    assert "all but those that are marked “set before the start” may be changed at any time" in page.words
    other = Page(documentation(oscillator(tool="no such tool")))
    assert other.row("Made with")[1] == "no such tool, 2026-01-02T03:04:05Z"


def test_the_example_sets_a_parameter_and_an_input(monkeypatch):
    calls = []
    monkeypatch.setattr(fmpy, "simulate_fmu", lambda *arguments, **more: calls.append((arguments, more)))
    for told in (oscillator(), description()):
        page = Page(documentation(told)).words
        exec(page[page.index("from fmpy") : page.index("Licence\n")])
    (names, policy), (_, least) = calls
    given = policy.pop("input")
    assert names == ("Mechanics_Box.fmu",)
    assert policy == dict(start_time=0.5, stop_time=4, output_interval=0.002, start_values={"m": 2.5})
    assert given.dtype.names == ("time", "f")
    assert [tuple(row) for row in given] == [(0.5, 0.1), (4.0, 0.1)]
    assert least == dict(stop_time=1, output_interval=0.004)


def test_the_page_has_no_scripts_and_its_links_lead_somewhere():
    page = Page(documentation(replace(oscillator(), name="<script>alert(1)</script>", license="<b>")))
    assert "script" not in page.tags
    assert "<script>alert(1)</script>" in page.words
    assert {"documentation/" + link for link in page.links} <= set(licenses(oscillator()))


def test_many_outputs_are_grouped_by_component_and_vectors_folded():
    names = [f"arms[{i}].bodies[{j}].r[{k}]" for i in range(4) for j in range(40) for k in range(3)]
    names += ["der(tool.v[0])", "der(tool.v[1])", "energy"]
    told = description(*(FmuVariable(name, 0, "output", "continuous", unit="m") for name in names))
    assert len(told.outputs) > MANY
    text = documentation(told)
    page = Page(text)
    assert page.tags.count("details") == 6
    for words in ("arms[3] (120)", "tool (2)", "the model itself (1)"):
        assert words in page.words
    assert page.row("arms[2].bodies[39].r[0] ... [2]")[1] == "m"
    assert page.row("der(tool.v[0]) ... [1])")
    few = description(*(FmuVariable(name, 0, "output", "continuous", unit="m") for name in names[:MANY]))
    assert len(text) < len(documentation(few))  # less than the flat table of fewer outputs
    assert "details" not in Page(documentation(few)).tags


def test_licences_of_model_runtime_and_generated_code():
    texts = licenses(oscillator())
    entry = texts["documentation/licenses/license.txt"].decode()
    for words in ("Mechanics.Box", "Licence: MIT", "A. Author", "BSD-3-Clause"):
        assert words in entry
    assert texts["documentation/licenses/gantrytau.txt"] == (ROOT / "LICENSE").read_bytes()
    assert "none was stated" in licenses(description())["documentation/licenses/license.txt"].decode()
