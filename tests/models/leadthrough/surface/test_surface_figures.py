"""Figures 8.4 and 8.5."""

import numpy as np
import pytest

from gantrytau import ModelError, Result
from gantrytau_models.leadthrough import plot_oscillation, plot_tool_force


def swinging(stop=4.0, hertz=68.0, amplitude=0.4):
    t = np.arange(0.0, stop, 0.004)
    return Result(t, {"f_n": 2 + amplitude * np.sin(2 * np.pi * hertz * t)}, units={"f_n": "N"})


def test_the_spectrum_shows_frequency_and_amplitude(tmp_path):
    figure = plot_oscillation({"gate 5 deg": swinging()}, begin=1.0, file=tmp_path / "8_5.png")
    line = figure.axes[1].lines[0]
    hertz, amplitude = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    assert abs(hertz[np.argmax(amplitude)] - 68) < 0.3
    assert np.isclose(amplitude.max(), 0.4, rtol=0.05)
    assert (tmp_path / "8_5.png").stat().st_size > 5000


def test_what_follows_a_release_is_left_out():
    run = swinging(8.0)
    force = np.where(run.time < 4.0, run["f_n"], 0.0)
    figure = plot_oscillation({"released": Result(run.time, {"f_n": force})}, begin=1.0)
    assert np.isclose(np.max(figure.axes[1].lines[0].get_ydata()), 0.4, rtol=0.05)


def test_each_run_has_a_panel(tmp_path):
    figure = plot_tool_force({"one": swinging(), "two": swinging()}, tmp_path / "8_4.png")
    assert [axes.get_title() for axes in figure.axes] == ["one", "two"]
    assert (tmp_path / "8_4.png").exists()


@pytest.mark.parametrize("draw", [plot_tool_force, plot_oscillation])
def test_no_runs_and_other_results_are_refused(draw):
    with pytest.raises(ModelError, match="found dict without runs, expected results by name"):
        draw({})
    with pytest.raises(ModelError, match="has no variable 'f_n'"):
        draw({"other": Result([0.0, 20.0], {"x": [0.0, 1.0]})})


def test_a_run_that_ends_before_is_refused():
    with pytest.raises(ModelError, match="found short on the surface for less than 100 samples from 8 s on"):
        plot_oscillation({"short": swinging()})
