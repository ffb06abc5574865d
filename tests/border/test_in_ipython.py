"""What IPython shows of errors, and offers behind Tab."""

import sys
import traceback

import pytest
from IPython.core.interactiveshell import InteractiveShell

from gantrytau import Model, Real, der, simulate

CELL = """
from gantrytau import Model, Real, der, simulate

class Falling(Model):
    x = Real(start=1.0, fixed=True)
    def equations(self):
        yield der(self.x) == -self.x / len(None)

def run():
    return simulate(Falling(), stop=1.0)

run()
"""


@pytest.fixture
def shell():
    """A shell, which is gone afterwards."""
    yield InteractiveShell.instance(colors="nocolor")
    InteractiveShell.clear_instance()


def test_tracebacks_have_the_frames_of_the_user_alone_with_the_cause(shell, capsys):
    shell.run_cell(CELL)
    shown = capsys.readouterr().out
    for line in (
        "== -self.x / len(None)",
        "TypeError: object of type",
        "return simulate(Falling(), stop=1.0)",
    ):
        assert line in shown
    assert "gantrytau/" not in shown
    # the error itself keeps all frames
    assert "flattening" in "".join(traceback.format_exception(sys.last_value))


LIBRARY = """
from contextlib import contextmanager
from gantrytau import ModelError

@contextmanager
def telling():
    try:
        yield
    except ZeroDivisionError as error:
        raise ModelError("divided by zero") from error

def library():
    with telling():
        1 / 0
"""


def test_context_managers_of_the_library_are_not_shown(shell, capsys):
    names = {"__name__": "gantrytau.made"}
    exec(LIBRARY, names)
    shell.push({"library": names["library"]})
    shell.run_cell("library()")
    shown = capsys.readouterr().out
    assert "ModelError: divided by zero" in shown
    assert "contextlib" not in shown
    assert "1 / 0" not in shown


class Falling(Model):
    """A variable and its derivative."""

    x = Real(start=1.0, fixed=True)

    def equations(self):
        yield der(self.x) == -self.x


def test_tab_offers_names_of_results_and_what_is_declared():
    offered = simulate(Falling(), stop=0.1)._ipython_key_completions_()
    assert {"time", "x", "der(x)"} <= set(offered)
    assert {name for name in dir(Falling()) if not name.startswith("_")} == {
        "x",
        "equations",
        "initial_equations",
        "modifications",
        "modified",
    }
