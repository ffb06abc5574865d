"""Text, LaTeX and HTML: complete, well formed, and with the origin of every equation."""

import re

import casadi as ca
import pytest
from matplotlib.mathtext import MathTextParser

from gantrytau import Input, Model, Parameter, Real, der, translate
from gantrytau.mechanics.translational import LinearFriction
from gantrytau_models import GantryTau, Pendulum, prototypes
from tests.writing.page_reader import PageOfEquations, Reader


class Rotor(Model):
    """A turning mass on a spring that is stiff to one side."""

    J = Parameter(2.0, unit="kg.m2", description="moment of inertia")
    phi_rel0 = Parameter(0.5, unit="rad", description='angle <of> rest & "more", 50 % of x_y')
    phi = Real(unit="rad", description="angle")
    w = Real(unit="rad/s", description="angular velocity")
    tau = Input(unit="N.m", description="torque")

    def equations(self):
        yield self.w == der(self.phi)
        yield self.J * der(self.w) == self.tau - 2e-7 * ca.fabs(self.phi - self.phi_rel0)


class Named(Model):
    """Names of every kind, with an awkward description."""

    shaft = Rotor()
    kinetic_energy = Real(unit="J", description="energy")
    power = Real(unit="W")
    r = Real(2, unit="1", start=0.3)

    def equations(self):
        yield self.kinetic_energy == self.shaft.J / 2 * self.shaft.w**2
        yield self.power == der(self.kinetic_energy)
        yield der(self.r) == -self.r


@pytest.fixture(scope="module", params=["pendulum", "robot", "names"])
def dae(request):
    models = {
        "pendulum": Pendulum,
        "robot": lambda: GantryTau(prototypes.L1, friction=LinearFriction),
        "names": Named,
    }
    return translate(models[request.param](), units=request.param != "names")


@pytest.fixture(scope="module")
def html(dae):
    return dae.equations("html")


def test_every_block_is_in_every_format(dae):
    text, latex, page = (dae.equations(f) for f in ("text", "latex", "html"))
    for number, block in enumerate(dae.blocks, start=1):
        assert f"\n[{number}] " in text
        assert rf"\paragraph{{Block {number}}}" in latex
        assert f"[{number}]" in page
        for key in block.equations:
            name = dae.reduced.equations[key[0]].name.partition(",")[0]
            assert name in text
            assert name in page or name.endswith("(connection)")
    assert latex.count(r"\begin{align*}") == len(dae.blocks)


def test_the_page_is_closed_in_itself_and_its_links_arrive(html):
    page = Reader(html).root
    anchors = page.values("id")
    assert len(anchors) == len(set(anchors))
    assert {link.removeprefix("#") for link in page.values("href")} <= set(anchors)
    assert "http" not in html
    assert not page.values("src")


def test_the_page_has_every_quantity_and_its_description(dae, html):
    names = {row.name for row in PageOfEquations(html).quantities.values()}
    assert names == {v.name for v in (*dae.flat.variables, *dae.flat.parameters, *dae.flat.propagated)}
    descriptions = {v.description for v in (*dae.flat.variables, *dae.flat.parameters)} - {""}
    assert descriptions <= {cell.text.strip() for cell in Reader(html).root.find("td")}


def test_latex_has_balanced_braces_and_environments(dae):
    latex = dae.equations("latex")
    bare = re.sub(r"\\[{}]", "", latex)
    depth = 0
    for letter in bare:
        depth += (letter == "{") - (letter == "}")
        assert depth >= 0
    assert depth == 0
    assert latex.count(r"\left") == latex.count(r"\right")
    stack = []
    for word, name in re.findall(r"\\(begin|end)\{([a-z*]+)\}", latex):
        assert word == "begin" or stack.pop() == name
        stack += [name] if word == "begin" else []
    assert stack == []
    outside = re.sub(r"\$[^$]*\$|\\begin\{align\*\}.*?\\end\{align\*\}|%.*", "", latex, flags=re.DOTALL)
    assert not re.search(r"(?<!\\)[_^&#]", outside)


def test_an_independent_reader_of_formulas_accepts_the_latex(dae):
    parser = MathTextParser("path")
    seen = set()
    blocks = r"\\begin\{align\*\}(.*?)\\end\{align\*\}"
    for body in re.findall(blocks, dae.equations("latex"), flags=re.DOTALL):
        if r"\begin{cases}" in body:  # which matplotlib does not know
            continue
        for row in body.strip().split(" \\\\\n"):
            assert row.count("&") == 1
            shape = re.sub(r"\d+", "0", row)
            if shape in seen:  # rows that differ in numbers only read alike
                continue
            seen.add(shape)
            parser.parse(f"${row.replace('&', '').replace(chr(92) + 'quad{}', '')}$")


def test_latex_writes_letters_indices_and_dots():
    latex = translate(Named(), units=False).equations("latex")
    parts = [
        r"\mathit{shaft}.\ddot{\varphi}",
        r"\mathit{shaft}.\tau",
        r"\varphi_{\mathit{rel0}}",
        r"\dot{r}_{0}",
    ]
    parts += [r"\mathit{kinetic\_energy}", r"2 \cdot 10^{-7}", r"\left|"]
    assert [part for part in parts if part not in latex] == []
