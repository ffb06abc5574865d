"""What users are told of wrong options: the option by its name, and nothing of Python, whatever the command."""

import re

import pytest

SIMULATE = ("simulate", "Pendulum", "--stop", "0.1")
PYTHON = re.compile(
    r"\bNone\b|Traceback|help\(|positional|keyword|\bdict\b|b'|TypeError|ValueError|Value error|parse string"
)
WRONG = {  # a command and an option with its value -> what is said
    (*SIMULATE, "--input", "u=prbs(1)"): "expected prbs(bits, hold, amplitude=1.0, seed), with at least bits and hold",
    (*SIMULATE, "--input", "u=chirp(low='a')"): "expected chirp(low, high, duration,",
    (*SIMULATE, "--input", "u=3"): "--input u: Pendulum has no variable or parameter 'u'",
    (*SIMULATE, "--outputs", "x,zz"): "--outputs zz: Pendulum has no variable or parameter 'zz'",
    (*SIMULATE, "--plot", "zz", "--to", "a.png"): "--plot zz: Pendulum has no variable or parameter 'zz'",
    (*SIMULATE, "--seed", "-1"): "--seed",
    (*SIMULATE, "--points", "1"): "--points",
    (*SIMULATE, "--points", "1.5"): "'--points': expected a whole number",
    (*SIMULATE, "--tolerance", "x"): "'--tolerance': expected a number, as 0.5",
    (*SIMULATE, "--limits", "end"): "'--limits': 'end' is not one of 'warn', 'stop', 'none'.",
    ("view", "Pendulum", "--pose", "zz=1"): "--pose zz: Pendulum has no variable or parameter 'zz'",
    ("equations", "Pendulum", "--format", "htlm"): "'--format': 'htlm' is not one of",
    ("equations", "Pendulum", "--given", "zz"): "--given zz: Pendulum has no variable or parameter 'zz'",
    ("fmu", "export", "Pendulum", "--states", "zz"): "--states zz: Pendulum has no variable or parameter 'zz'",
    ("fmu", "export", "Pendulum", "--solver", "rodas"): "'--solver': 'rodas' is not one of",
}  # fmt: skip


@pytest.mark.parametrize("arguments", WRONG, ids=" ".join)
def test_a_wrong_option_is_named_and_python_is_not(fails, arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    spoken = " ".join(re.sub(r"[│╭╮╰╯─]", "", said(fails, arguments)).split())
    assert WRONG[arguments] in spoken
    assert PYTHON.search(spoken) is None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("arguments", [("panel", "--port", "-1"), ("stream", "a.csv", "--port", "99999")])
def test_ports_that_cannot_be_are_refused_before_anybody_is_called(run, arguments):
    spoken = run("controller", *arguments)
    assert spoken.exit_code == 2
    assert re.search(r"'--port': expected at (least 1|most 65535)", spoken.stderr)


def said(fails, arguments):
    """The message; that of options whose values are none is in a frame on the terminal, and plain as JSON."""
    try:
        return fails(2, *arguments)
    except AssertionError as error:
        if "╭" not in str(error):
            raise
        return str(error)
