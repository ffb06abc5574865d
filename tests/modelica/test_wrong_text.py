"""What is said of wrong Modelica text: line, column, found and expected."""

from typing import Any

import pytest

import gantrytau
from gantrytau import ModelError, load_modelica

WRONG = (  # text of a model, line and column, words
    ("model M\n  Real x = 2 * yy;\n  Real y = 1;\nend M;", "2:16", "found the name 'yy'.*did you mean 'y'"),
    ("model M\n  Rael x;\nend M;", "2:3", "found 'Rael', expected the name of a class; did you mean 'Real'"),
    (
        "model M\n  Real x(strat=1) = 1;\nend M;",
        "2:10",
        "found 'strat', unknown to Real; did you mean 'start'",
    ),
    (
        "model A\n  Real x = 1;\nend A;\nmodel M\n  A a(y=2);\nend M;",
        "5:7",
        "found 'y' modified, which A lacks",
    ),
    ("model A\n  final parameter Real x = 1;\nend A;\nmodel M\n  A a(x=2);\nend M;", "5:7", ".*'final'"),
    (
        "model M\n  Real x[3] = {1, 2, 3} + {1, 2};\nend M;",
        "2:15",
        "found sizes \\[3\\] and \\[2\\] beside '\\+'",
    ),
    (
        "model M\n  Real x[3] = {1, 2, 3};\n  Real y = x[4];\nend M;",
        "3:12",
        "found the index 4, expected 1 to 3",
    ),
    ("model M\n  extends M;\nend M;", "1:7", "found M among its own bases, expected no circle"),
    (
        "model M\n  Real x;\nequation\n  x = inStream(x);\nend M;",
        "4:7",
        "found inStream\\(\\), which is not supported",
    ),
    ("model M\n  Modelica.Electrical.R r;\nend M;", "2:3", "found 'Modelica.*libraries="),
    (
        "model M\n  Real x;\nequation\n  if time > 1 then\n    x = 1;\n  end if;\nend M;",
        "4:3",
        "found 1 and 0 equations",
    ),
    (
        "model M\n  Integer n(start=0);\nequation\n  when n > pre(n) then\n    n = pre(n) + 1;\n  end when;\nend M;",
        "4:3",
        "found n beside pre\\(n\\) in the condition of when",
    ),
    (
        "model M\n  parameter Integer n = n + 1;\n  Real x[n];\nend M;",
        "2:25",
        "found 'n', whose value needs itself",
    ),
)
FUNCTION = "function f\n  input Real u[2];\n  output Integer n = integer(u[1]);\nend f;\n"
MEANINGS = (  # where a wrong model would run: text, line and column, words
    (
        "record R\n  Real a;\nend R;\nrecord S\n  Real b;\nend S;\nmodel M\n  R r = S(time);\nend M;",
        "8:9",
        "found a value without 'a' for a record, expected one of its type",
    ),
    (
        "function f\n  input Real a, b;\n  output Real y = a * b;\nalgorithm\nend f;\n"
        "model M\n  Real x[2] = f({time, 2}, {1, 2, 3});\nend M;",
        "7:15",
        "found arrays of the sizes \\[2\\] and \\[3\\] for scalars of f, expected one size",
    ),
    (
        "model M\n  Real v[2] = {1, time};\n  Real y[2] = v ^ 2;\nend M;",
        "3:15",
        "found \\[2\\] and a scalar beside '\\^', expected a square matrix",
    ),
    (
        "model M\n  Real x = sin(Integer(time));\nend M;",
        "2:16",
        "found Real in Integer\\(\\), expected a value of an enumeration",
    ),
    (
        "model M\n  input Real u;\n  Real y;\nalgorithm\n  u := 2;\n  y := u;\nend M;",
        "5:3",
        "found the input 'u' assigned, expected a variable",
    ),
    (
        "model M\n  parameter Real p = 1;\n  Real y;\nalgorithm\n  p := 2;\n  y := p;\nend M;",
        "5:3",
        "found the parameter 'p' assigned, expected a variable",
    ),
    (
        "model M\n  Real x = Integer(time);\nend M;",
        "2:12",
        "found Real in Integer\\(\\), expected a value of an",
    ),
    (
        "model A\n  parameter Real p;\nend A;\nmodel M\n  A a[2](p={1, 2, 3});\nend M;",
        "5:10",
        "found 3 values for",
    ),
    ("model M\n  Real x[2](start=1);\nend M;", "2:13", "found a scalar, expected \\[2\\]; 'each'"),
    (
        FUNCTION + "model M\n  Real x = f({1, 2, 3});\nend M;",
        "6:12",
        "found \\[3\\] for 'u' of f, expected \\[2\\]",
    ),
    ("model M\n  Boolean b = time;\nend M;", "2:15", "found Real for 'b', expected Boolean"),
    ("model M\n  parameter String s = 3.5;\nend M;", "2:24", "found 3.5 for 's', expected String"),
    ("model M\n  Boolean b = time > 1;\n  Real x = b + 1;\nend M;", "3:12", "found Boolean beside '\\+'"),
    (
        "model M\n  Integer n(start=0);\nequation\n  when time > 1 then\n    n = 2 * time;\n  end when;\nend M;",
        "5:9",
        "found Real .*, expected Integer; integer\\(\\)",
    ),
    (
        "type E = enumeration(a);\ntype F = enumeration(c);\nmodel M\n  parameter E e = E.a;\n"
        "  Boolean b = e == F.c;\nend M;",
        "5:20",
        "found F beside E",
    ),
    (
        "package A\n  constant Real k=1;\nend A;\npackage B\n  constant Real k=2;\nend B;\nmodel M\n  import A.*;\n"
        "  import B.*;\n  Real x = k;\nend M;",
        "9:10",
        "found 'k' imported as A.k and as B.k",
    ),
    (
        "model A\n  constant Real k=1;\nend A;\nmodel B\n  constant Real k=2;\nend B;\nmodel M\n  extends A;\n"
        "  extends B;\nend M;",
        "7:7",
        "found 'k' declared differently in A and in B",
    ),
    (
        "model A\n  type T = Real(start=3);\nend A;\nmodel B\n  type T = Real(start=4);\nend B;\nmodel M\n  extends A;\n"
        "  extends B;\n  T x = 1;\nend M;",
        "7:7",
        "found 'T' declared differently in A and in B",
    ),
    (
        "package P\n  type T = Real(start=3);\n  model A\n    T x;\n  end A;\nend P;\npackage Q\n  type T = Real(start=4);\n"
        "  model A\n    T x;\n  end A;\nend Q;\nmodel M\n  extends P.A;\n  extends Q.A;\nend M;",
        "13:7",
        "found 'x' declared differently in P.A and in Q.A",
    ),
    (
        "model M\n  Real x = mod(time, 0);\nend M;",
        "2:12",
        "found mod\\(..., 0\\), expected a divisor other than",
    ),
    ("model M\n  Real x[2] = rem({3, 4}, {time, 0});\nend M;", "2:15", "found rem\\(..., 0\\), expected"),
    (
        "model M\n  Real x = div(3, 0);\nend M;",
        "2:12",
        "found div\\(..., 0\\), expected a divisor other than",
    ),
    (
        "model A\nprotected\n  parameter Real p=1;\nend A;\nmodel M\n  A a(p=2);\nend M;",
        "6:7",
        "found 'p' modified, which is protected in A",
    ),
    (
        "model A\n  Real x = 1;\nend A;\nmodel B\n  Real z = 1;\nend B;\nmodel H\n  replaceable A a;\nend H;\nmodel M\n"
        "  H h(redeclare B a);\nend M;",
        "11:17",
        "found B for what A constrains, but it has no 'x'",
    ),
    (
        "connector U = input Real;\nconnector Y = output Boolean;\nmodel M\n  U u;\n  Y y = time > 1;\nequation\n"
        "  connect(u, y);\nend M;",
        "7:3",
        "found connectors of Real and Boolean",
    ),
)


@pytest.mark.parametrize(("text", "place", "words"), [*WRONG, *MEANINGS])
def test_wrong_text_is_refused_by_line_and_column(text, place, words, tmp_path):
    (tmp_path / "wrong.mo").write_text(text)
    line, column = place.split(":")
    with pytest.raises(ModelError, match=f"line {line}, column {column}: {words}"):
        gantrytau.flatten(load_modelica(tmp_path / "wrong.mo")["M"]())


def test_what_is_no_path_another_encoding_and_a_folder_without_its_package_are_refused(tmp_path):
    (tmp_path / "wide.mo").write_text("model M end M;", encoding="utf-16")
    (tmp_path / "Lib").mkdir()
    (tmp_path / "Lib" / "A.mo").write_text("model A end A;")
    (tmp_path / "use.mo").write_text("model M\n  Lib.A a;\nend M;")
    three: Any = 3
    for given, words in (
        (three, "found 3, expected the path"),
        (tmp_path / "wide.mo", "in UTF-16, .*iconv -f utf-16"),
    ):
        with pytest.raises(ModelError, match=words):
            load_modelica(given)
    with pytest.raises(ModelError, match="found 3, expected the path"):
        load_modelica(tmp_path / "use.mo", libraries=three)
    with pytest.raises(ModelError, match="Lib: found a folder without package"):
        gantrytau.flatten(load_modelica(tmp_path / "use.mo", libraries=[tmp_path])["M"]())
