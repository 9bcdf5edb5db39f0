"""The omni paper's figures: what they show is what was computed, and every axis has its unit."""

from pathlib import Path

import numpy as np
import pytest

from jaxid.logs import read_logs
from jaxid.papers.omni import figures as omni_figures
from jaxid.papers.omni.closed_loop import closed_loop
from jaxid.papers.omni.experiments import method_1, method_2
from jaxid.papers.omni.hanging import method_3, read_hanging
from jaxid.papers.omni.printed import TABLE_1

DEMO = Path(__file__).parents[3] / "jaxid/demo_logs/omni_paper"


@pytest.fixture(scope="module")
def results():
    steady = read_logs(DEMO / "steady_*.csv", robot="omni")
    coast = read_logs(DEMO / "coast_*.csv", robot="omni")
    hanging = read_hanging(DEMO / "hanging_1.csv")
    first = method_1(steady)
    return steady, coast, hanging, first, method_2(coast, first), method_3(hanging)


def labelled(figure, panels):
    assert len(figure.axes) == panels
    for ax in figure.axes:
        assert "[" in ax.get_xlabel() and "[" in ax.get_ylabel()
        assert ax.lines


def test_every_figure_has_units_and_the_data(results):
    steady, coast, hanging, first, second, third = results
    figure = omni_figures.steady_run(steady["steady_V_1.0.csv"], first)
    labelled(figure, 2)
    assert [line.get_label() for line in figure.axes[1].lines] == ["i2", "i4"]
    np.testing.assert_array_equal(figure.axes[0].lines[0].get_ydata(), steady["steady_V_1.0.csv"].output("V"))

    figure = omni_figures.friction_lines(first.friction)
    labelled(figure, 3)
    np.testing.assert_array_equal(figure.axes[1].lines[0].get_ydata(), TABLE_1["Vn"][1])
    labelled(omni_figures.friction_lines(), 3)

    labelled(omni_figures.coast_down(coast["coast_W.csv"], second), 2)
    figure = omni_figures.hanging(hanging[0], third.experiments["hanging_1.csv"])
    labelled(figure, 2)
    fitted = figure.axes[0].lines[1].get_ydata()
    assert np.std(hanging[0].output("theta") - fitted) == pytest.approx(0.01, rel=0.15)  # the log's noise


def test_closed_loop_figures_show_both_curves_of_every_motor_that_drives_the_axis():
    for axis, reference, motors in (("Vn", (0.0, 1.0, 0.0), (1, 3)), ("W", (0.0, 0.0, 1.0), (1, 2, 3, 4))):
        run, real = closed_loop(reference, duration=0.4), read_logs(DEMO / f"control_{axis}.csv", robot="omni")[0]
        figure = omni_figures.closed_loop(run, axis, real)
        labelled(figure, 1 + 2 * len(motors))
        panels = {ax.get_title("left"): ax for ax in figure.axes}
        logged, simulated = panels[f"speed {axis}"].lines[1:]
        assert (logged.get_label(), simulated.get_label()) == ("real", "simulated")
        np.testing.assert_array_equal(logged.get_ydata(), real.output(axis))
        for motor in motors:
            logged, simulated = panels[f"current, motor {motor}"].lines
            np.testing.assert_array_equal(logged.get_ydata(), real.output(f"i{motor}"))
            np.testing.assert_array_equal(simulated.get_ydata(), run.currents[:, motor - 1])
            logged, simulated = panels[f"PWM, motor {motor}"].lines
            np.testing.assert_allclose(logged.get_ydata(), 255 / 24 * real.input(f"u{motor}"))
            np.testing.assert_array_equal(simulated.get_ydata(), run.duty[:, motor - 1])
