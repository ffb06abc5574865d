"""Systems as SSP files: written by the schema, read back, read from others, and refused by name."""

import zipfile

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_fmu import Master, cosimulate
from gantrytau_fmu.systems.ssp.read_ssp import STRUCTURE
from gantrytau_fmu.systems.ssp.write_ssp import write_ssp
from tests.fmu.systems.small_fmus import variable

SPACES = "http://ssp-standard.org/SSP1/SystemStructure"
HEAD = (
    f'<ssd:SystemStructureDescription xmlns:ssd="{SPACES}Description" xmlns:ssc="{SPACES}Common" '
    f'xmlns:ssv="{SPACES}ParameterValues" version="1.0" name="s">'
)
WIRES = [("a.y", "b.u"), ("b.y", "a.u")]


def lag(build, name, start, fmi="2.0"):
    """y' = k (u - y), exact under held inputs."""
    lines = [
        variable("u", "input", 0.0, unit="m"),
        variable("k", "parameter", 2.0),
        variable("y", "output", start, unit="m"),
        variable("n", "parameter", 3, kind="integer", variability="fixed"),
    ]
    return build(f"{name}{fmi[0]}", lines, advance="v[2] = v[0] + (v[2] - v[0]) * exp(-v[1] * h);", fmi=fmi)


@pytest.fixture(scope="module")
def files(build):
    return {"a": lag(build, "first", 0.0), "b": lag(build, "second", 0.0)}


def system(folder, inside, files, experiment=""):
    """An SSP of another tool: what is inside its outermost system, and FMU files in resources."""
    path = folder / "other.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        text = (
            f'{HEAD}<ssd:System name="s">{inside}</ssd:System>{experiment}</ssd:SystemStructureDescription>'
        )
        archive.writestr(STRUCTURE, text)
        for name, file in files.items():
            archive.write(file, f"resources/{name}.fmu")
    return path


def component(name, source, more=""):
    connectors = '<ssd:Connector name="u" kind="input"/><ssd:Connector name="y" kind="output"/>'
    return (
        f'<ssd:Component name="{name}" source="resources/{source}.fmu">'
        f"<ssd:Connectors>{connectors}</ssd:Connectors>{more}</ssd:Component>"
    )


def connection(start, end, inner=""):
    names = []
    for side, name in (("start", start), ("end", end)):
        owner, _, connector = name.rpartition(".")
        names.append((f'{side}Element="{owner}" ' if owner else "") + f'{side}Connector="{connector}"')
    return f"<ssd:Connection {' '.join(names)}>{inner}</ssd:Connection>"


def binding(values, prefix=""):
    inner = "".join(f'<ssv:Parameter name="{name}">{value}</ssv:Parameter>' for name, value in values.items())
    return (
        f'<ssd:ParameterBindings><ssd:ParameterBinding prefix="{prefix}"><ssd:ParameterValues>'
        f'<ssv:ParameterSet version="1.0" name="p"><ssv:Parameters>{inner}</ssv:Parameters></ssv:ParameterSet>'
        "</ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    )


def bound(kind, value):
    """The component a with a value of k."""
    return component("a", "a", binding({"k": f'<ssv:{kind} value="{value}"/>'}))


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_written_system_runs_as_the_same_system(tmp_path, build, fmi):
    files = {"a": lag(build, "p", 1.0, fmi), "b": lag(build, "q", 0.5, fmi)}
    start = {"a.k": 3.0, "b.n": 4}
    path = write_ssp(tmp_path / "two.ssp", files, WIRES, stop=1.0, step=0.1, start=start)
    direct = cosimulate(files, WIRES, stop=1.0, step=0.1, start=start)
    read = cosimulate(path)
    assert np.array_equal(read.time, direct.time)
    assert all(np.array_equal(read[name], direct[name]) for name in direct.names)
    longer = cosimulate(path, stop=2.0, step=0.05, start={"a.k": 1.0}, outputs=["a.k", "b.n"])
    assert (longer.final("a.k"), longer.final("b.n"), longer.time.size) == (1.0, 4.0, 41)


def test_a_written_system_passes_the_schema_and_runs_in_fmpy_as_jacobi(tmp_path, build, files):
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import read_ssd

    lines = [variable("u", "input", 0.0, unit="m"), variable("y", "output", 0.0, unit="m")]
    ramp = build("ramp", lines, advance="v[1] += h * (1 - v[0]);")
    path = write_ssp(tmp_path / "two.ssp", {"a": ramp, "b": files["b"]}, WIRES, stop=1.0, step=0.1)
    assert [(unit.name, unit.m) for unit in read_ssd(str(path), validate=True).units] == [("m", 1)]
    theirs = simulate_ssp(str(path), stop_time=0.95, step_size=0.1)
    ours = cosimulate(
        path, master=Master(order="jacobi")
    )  # FMPy begins with zeros instead of outputs, which here is the same
    assert abs(ours.final("b.y")) > 0.1
    assert theirs["b.y"] == pytest.approx(ours["b.y"][1:], abs=1e-15)
    assert theirs["a.y"] == pytest.approx(ours["a.y"][1:], abs=1e-15)


def test_equal_systems_give_equal_files_and_share_fmus(tmp_path, files):
    same = {"a": files["a"], "b": files["a"]}
    contents = [
        write_ssp(tmp_path / f"{name}.ssp", same, WIRES, stop=1, step=0.1).read_bytes() for name in "xx"
    ]
    assert contents[0] == contents[1]
    with zipfile.ZipFile(tmp_path / "x.ssp") as archive:
        assert archive.namelist() == [STRUCTURE, "resources/first2.fmu"]
    assert not list(tmp_path.glob(".*"))


def test_nested_systems_are_flattened_with_their_transformations(tmp_path, files):
    double = '<ssc:LinearTransformation factor="2" offset="1"/>'
    inner = (
        '<ssd:System name="inner"><ssd:Connectors><ssd:Connector name="in" kind="input"/>'
        '<ssd:Connector name="out" kind="output"/></ssd:Connectors>'
        f"<ssd:Elements>{component('b', 'b')}</ssd:Elements><ssd:Connections>"
        f"{connection('in', 'b.u', double)}{connection('out', 'b.y')}</ssd:Connections></ssd:System>"
    )  # the second connection is written from its end to its start
    inside = (
        f"<ssd:Elements>{component('a', 'a')}{inner}</ssd:Elements>"
        f"<ssd:Connections>{connection('a.y', 'inner.in', double)}{connection('a.u', 'inner.out')}</ssd:Connections>"
        + binding(
            {
                "inner.b.k": '<ssv:Real value="5"/>',
                "a.n": '<ssv:Integer value="7"/>',
                "no.such": '<ssv:Real value="5"/>',
            }
        )
    )
    path = system(tmp_path, inside, files, '<ssd:DefaultExperiment startTime="0.5" stopTime="1"/>')
    found = cosimulate(path, step=0.1, outputs=["a.y", "a.u", "a.n", "inner.b.y", "inner.b.u", "inner.b.k"])
    assert found.time[[0, -1]] == pytest.approx([0.5, 1.0])
    assert found["inner.b.u"] == pytest.approx(4 * found["a.y"] + 3)
    assert np.array_equal(found["a.u"], found["inner.b.y"])
    assert (found.final("inner.b.k"), found.final("a.n")) == (5.0, 7.0)


def test_inner_bindings_give_way_to_outer_ones(tmp_path, files):
    inside = f"<ssd:Elements>{bound('Real', '1')}</ssd:Elements>" + binding(
        {"k": '<ssv:Real value="9"/>'}, prefix="a."
    )
    assert cosimulate(system(tmp_path, inside, files), stop=1, step=1, outputs=["a.k"]).final("a.k") == 9.0


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        (
            '<ssd:Elements><ssd:SignalDictionaryReference name="d" dictionary="d"/></ssd:Elements>',
            "element 'd' is a Signal",
        ),
        ("<ssd:SignalDictionaries/>", "SignalDictionaries"),
        ('<ssd:Elements><ssd:Component name="a" source="../a.fmu"/></ssd:Elements>', r"'\.\./a\.fmu', which"),
        (
            '<ssd:Elements><ssd:Component name="a" source="http://x/a.fmu"/></ssd:Elements>',
            "which is no file of",
        ),
        (
            '<ssd:Elements><ssd:Component name="a" source="resources/z.fmu"/></ssd:Elements>',
            "names resources/z.fmu",
        ),
        (
            '<ssd:Elements><ssd:Component name="a" type="application/x-ssp-package" source="a.ssp"/></ssd:Elements>',
            "component 'a' is of type application/x-ssp-package",
        ),
        (
            '<ssd:Elements><ssd:Component name="a" implementation="ModelExchange" source="resources/a.fmu"/></ssd:Elements>',
            "component 'a' asks for Model Exchange",
        ),
        (f"<ssd:Elements>{component('a', 'a')}{component('a', 'b')}</ssd:Elements>", "'a' stands for two"),
        (
            f"<ssd:Elements>{component('a', 'a')}{component('b', 'b')}</ssd:Elements><ssd:Connections>"
            f"{connection('a.y', 'b.u', '<ssc:EnumerationMapping/>')}</ssd:Connections>",
            r"connection a\.y -> b\.u has a EnumerationMapping",
        ),
        (
            f"<ssd:Elements>{component('a', 'a')}{component('b', 'b')}</ssd:Elements><ssd:Connections>"
            f"{connection('a.y', 'b.u')}{connection('b.y', 'b.u')}</ssd:Connections>",
            r"b\.u is driven by a\.y and by b\.y",
        ),
        (f"<ssd:Elements>{bound('Real', 'x')}</ssd:Elements>", r"a\.k: found 'x', expected a number"),
        (f"<ssd:Elements>{bound('Binary', 'x')}</ssd:Elements>", r"a\.k is of type Binary"),
    ],
)
def test_what_is_not_supported_is_refused_by_name(tmp_path, files, inside, words):
    with pytest.raises(ModelError, match=words):
        cosimulate(system(tmp_path, inside, files), stop=1.0, step=0.1)


def test_archives_that_are_no_systems_are_refused(tmp_path, files):
    with pytest.raises(ModelError, match=r"is one FMU, expected a system"):
        cosimulate(files["a"], stop=1.0, step=0.1)
    path = tmp_path / "bad.ssp"
    for text in ("<a/>", "<a", '<!DOCTYPE a [<!ENTITY b "b">]><a>&b;</a>'):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(STRUCTURE, text)
        with pytest.raises(ModelError, match=r"bad\.ssp"):
            cosimulate(path, stop=1.0, step=0.1)
    with pytest.raises(ModelError, match=r"brings its own"):
        cosimulate(path, WIRES, stop=1.0, step=0.1)


def test_wrong_places_and_systems_are_not_written(tmp_path, build, files):
    for path, words in [
        (tmp_path / "a.zip", r"found the suffix '\.zip', expected '\.ssp'; call it a\.ssp"),
        (tmp_path / "no" / "a.ssp", r"the folder '.*no' does not exist"),
    ]:
        with pytest.raises(ModelError, match=words):
            write_ssp(path, files, WIRES, stop=1.0, step=0.1)
    with pytest.raises(ModelError, match=r"found step=0\.0, expected more than 0"):
        write_ssp(tmp_path / "a.ssp", files, WIRES, stop=1.0, step=0.0)
    with pytest.raises(ModelError, match=r"a has no variable 'q'"):
        write_ssp(tmp_path / "a.ssp", files, [("a.q", "b.u")], stop=1.0, step=0.1)
    with pytest.raises(ModelError, match=r"component 'a b': expected a name of letters.*; rename it"):
        write_ssp(tmp_path / "a.ssp", {"a b": files["a"]}, [], stop=1.0, step=0.1)
    assert not list(tmp_path.iterdir())
    (tmp_path / "folder.ssp").mkdir()
    with pytest.raises(ModelError, match=r"found a folder, expected a file that ends in '\.ssp'"):
        write_ssp(tmp_path / "folder.ssp", files, WIRES, stop=1.0, step=0.1)
