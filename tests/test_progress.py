"""Lines on the screen for what takes long."""

import io
import sys
import time
from contextlib import contextmanager

import pytest

from gantrytau import progress
from gantrytau.progress import Progress, shows_progress, silent, tell
from gantrytau_optimica.solving.clock import Clock


class Screen(list):
    """Lines that were shown."""

    @contextmanager
    def __call__(self):
        yield lambda words, share: self.append(words)

    def shows(self, words):
        """Whether a line comes, at the latest in 20 s."""
        late = time.monotonic() + 20
        while words not in self and time.monotonic() < late:
            time.sleep(0.01)
        return words in self


@pytest.fixture
def screen(monkeypatch):
    """A screen without waiting."""
    found = Screen()
    monkeypatch.setattr(progress, "LONG", 0.0)
    monkeypatch.setattr(progress, "_screen", lambda: found)
    return found


@shows_progress
def work(screen, seen, progress=None):
    """What takes long, and has a part that would show its own."""
    tell("round 2")
    with Progress("part of it", 0.0, 1.0):
        assert not seen or screen.shows("work: round 2, 0 s")


def test_a_line_says_what_is_at_work_and_its_parts_show_none(screen):
    work(screen, seen=True)
    assert not any("part of it" in words for words in screen)


def test_a_caller_who_is_told_sees_no_line(screen):
    work(screen, seen=False, progress=print)
    with silent():
        work(screen, seen=False)
    assert not screen


def test_a_solver_tells_its_iterations(screen):
    with Progress("optimize Fastest"):
        clock = Clock(1.0)
        clock.enter("round 2 of at most 13")
        clock.tell(7, 1.25)
        assert screen.shows("optimize Fastest: round 2 of at most 13, iteration 7, objective 1.25, 0 s")


class Terminal(io.StringIO):
    """Somebody watches."""

    def isatty(self):
        return True


def test_terminals_have_a_bar_and_files_none(monkeypatch):
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    monkeypatch.setenv("TERM", "xterm")
    assert progress._screen() is progress._on_terminal
    with progress._on_terminal() as draw:
        draw("simulate, 3 s", 0.5)
    assert "simulate, 3 s" in terminal.getvalue()
    monkeypatch.setenv("GANTRYTAU_PROGRESS", "0")
    assert progress._screen() is None
    monkeypatch.delenv("GANTRYTAU_PROGRESS")
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert progress._screen() is None
