"""The Pioneer paper's Tables 3-5 and figures 2-4: from logs of an independent simulator whose numbers are known."""

import math
from pathlib import Path

import numpy as np
import pytest

from jaxid.logs import PIONEER, Log, LogError, LogSet, read_logs
from jaxid.papers.pioneer import experiments as pioneer_paper
from jaxid.papers.pioneer import figures as pioneer_figures
from jaxid.papers.pioneer import printed
from jaxid.robots import Pioneer
from reference import excitation, logs
from reference import pioneer as reference_pioneer

DEMO = Path(__file__).parents[3] / "jaxid/demo_logs/pioneer_paper"
NOISE = 0.01  # m/s, of the demonstration logs


@pytest.fixture(scope="module")
def truth(demo_truth):
    return demo_truth("pioneer_paper")


@pytest.fixture(scope="module")
def straight(truth):
    return pioneer_paper.straight_experiments(read_logs(DEMO / "straight_*.csv", robot="pioneer"), truth=truth)


@pytest.fixture(scope="module")
def spot(straight, truth):
    return pioneer_paper.spot_experiments(read_logs(DEMO / "spot_*.csv", robot="pioneer"), straight.robot, truth=truth)


@pytest.fixture(scope="module")
def check(straight):
    return pioneer_paper.check_model(straight.robot, read_logs(DEMO / "validation_step.csv", robot="pioneer")[0])


def test_printed_means_are_the_means_of_the_printed_experiments():
    for table in (printed.TABLE_3, printed.TABLE_4):
        for *experiments, mean in table.values():
            last_digit = 10.0 ** -len(str(mean).split(".")[1])
            assert np.mean(experiments) == pytest.approx(mean, abs=0.51 * last_digit)


def test_the_pioneer_has_the_numbers_of_table_5():
    assert {name: Pioneer().parameters[name].value for name in printed.TABLE_5} == printed.TABLE_5


def test_table_3_finds_what_the_logs_were_simulated_with(straight):
    known = {"1/a11": 17.0776, "Cv": 0.0444, "Cs": 0.3184}
    for fit in straight.fits.values():
        for name, value in known.items():
            assert abs(fit[name].value - value) < 3.5 * fit[name].std_error
            assert abs(fit[name].value / value - 1) < 0.02
    for name, estimate in straight.mean.items():
        assert estimate.value == pytest.approx(np.mean([fit[name].value for fit in straight.fits.values()]))
        # The model that is built from the means has them.
        p = straight.robot.parameters.numbers
        built = straight.robot.combinations["1/a11"][0](p) if name == "1/a11" else p[name]
        assert built == pytest.approx(estimate.value)


def test_table_3_has_the_papers_layout_and_numbers(straight):
    table = straight.table
    assert table.column("Exp.") == ("1", "2", "3", "Mean", "Truth")
    assert table.column("Input") == ("PRBS", "PRBS", "STEP", "", "")
    assert table.column("1/a11 (paper)") == (17.83, 16.49, 16.89, 17.07, None)
    assert table.column("Cs (paper)") == (0.3349, 0.3287, 0.2921, 0.3186, None)
    assert table.column("1/a11 [kg]")[-1] == "17.08"
    assert repr(straight).startswith("Table 3. Translational movement") and "17.83" in straight._repr_html_()


def test_equation_35_finds_the_inertia_of_a_robot_that_stays_on_the_spot():
    """Centre of mass on the axle, caster where it stays put: the case that equation 35 describes."""
    robot = reference_pioneer.PIONEER.with_parameters(ym=0.0)
    inputs = excitation.wheels(np.zeros(1001), excitation.prbs(1001, 30, 1.2, 3.0, np.random.default_rng(5)))
    across = -math.acos(-0.03 / 0.18)
    frame = logs.simulate_log(robot, inputs, 0.02, (0.01, 0.02), 5, start={3: across})
    log = Log.from_arrays("prbs", frame["t"], frame[["V2", "V3"]], frame[["eta1", "eta2"]], PIONEER)
    movement = pioneer_paper.spot_experiments([log])
    J22 = 0.424179 - 15.5 * 0.07**2  # 1/a22 of the published robot less its M ym^2
    found = movement.mean["1/a22"]
    assert abs(found.value - J22) < 4 * found.std_error and abs(found.value / J22 - 1) < 0.02
    # The caster rests in the body and does not rub.
    assert abs(movement.mean["Cs1"].value) < 0.02
    with pytest.raises(LogError, match="straight"):
        pioneer_paper.straight_experiments([log.window(0, 0.1)])


def test_equation_35_takes_the_drift_of_a_coupled_robot_for_caster_friction(spot, truth):
    assert all(np.mean(read_logs(DEMO / name, robot="pioneer")[0].output("eta1")) < -0.01 for name in spot.fits)
    assert spot.mean["Cv1"].value > 50 * truth["Cv1"]
    assert spot.mean["Cs1"].value < 0  # not cut off at zero, or the mean would be wrong
    assert spot.table.column("Input")[:3] == ("STEP", "PRBS", "PRBS")
    assert spot.table.column("Cs1 (paper)")[:4] == (0.004535, 0.004532, 0.004541, 0.004536)


def test_table_5_is_a_robot_with_both_inertias(straight, spot):
    both = pioneer_paper.Identified(straight, spot)
    p = both.robot.parameters.numbers
    assert both.robot.combinations["1/a11"][0](p) == pytest.approx(straight.mean["1/a11"].value)
    assert both.robot.combinations["1/a22"][0](p) == pytest.approx(spot.mean["1/a22"].value)
    assert p["Cs1"] == 0.0 and p["Cs"] == pytest.approx(straight.mean["Cs"].value)
    assert both.table.column("Symbol") == ("I0", "Ir1", "Ir", "Ip1", "Ip", "Cs1", "Cv1", "Cs", "Cv")
    assert both.table.column("Paper") == (0.3, 2.144e-4, 0.0012, 1.072e-4, 5.95e-4, 0.004536, 0.000429, 0.3184, 0.0444)


def test_the_casters_share_follows_from_the_published_numbers():
    ratio = 0.1689 / 0.0825
    motor = 19.7**2 * 0.73 * 0.023**2 / 0.71
    viscous, coulomb = 2 * ratio**2 * (motor + 0.0444), 2 * ratio * (0.3184 + 19.7 * 0.73 * 5.6e-3)
    table = pioneer_paper.turning_resistance()
    assert table.column("driving wheels") == pytest.approx((viscous, coulomb))
    assert table.column("all") == pytest.approx((viscous + 0.000429, coulomb + 0.004536))
    assert table.column("caster's share") == ("0.02 %", "0.28 %")
    # 2 L Cs / R = 1.304 N m, a hundredth of it 2.9 times 0.004536; 0.3349 - 0.2921; (4541 - 4532) 1e-6 / 1.638.
    assert "2.9 times" in table.notes[0]
    assert (
        "0.043 N m" in table.notes[1] and "9e-06 N m" in table.notes[1] and "5.5 parts in a million" in table.notes[1]
    )


def test_scatter_is_that_of_the_three_experiments(straight):
    assert straight.fits  # by half a second; the same fits again stand for another way
    table = pioneer_paper.scatter({"one": straight, "other": straight})
    values = [fit["Cs"].value for fit in straight.fits.values()]
    one, other, paper, ratio = (table.column(name)[2] for name in table.columns[1:])
    assert one == other == f"{100 * np.std(values, ddof=1) / np.mean(values):.2g} %"
    assert paper == "7.3 %" and ratio == "1.0 to 1.0"  # the paper's 0.3349, 0.3287, 0.2921 have 0.0231 over 0.3186


def test_residual_of_the_validation_is_the_sensors_noise(check):
    residual = check.found.residuals["eta1"]["validation_step.csv"]
    assert residual.std() == pytest.approx(NOISE, rel=0.06)
    assert abs(residual.mean()) < 4 * NOISE / math.sqrt(len(residual))
    tests = check.found.tests["eta1"]
    assert not tests.whiteness.rejected and not tests.normality.rejected
    assert check.table.column("Value") == pytest.approx((residual.mean(), residual.std()))
    assert check.table.column("Paper") == (-1.4864e-4, 0.0367)


def test_figures_show_the_log_the_force_and_the_model(check):
    log = check.log
    figure = pioneer_figures.figure_2(log)
    volts, push, speed = figure.axes
    np.testing.assert_array_equal(volts.lines[1].get_ydata(), log.input("V3"))
    per_volt = 19.7 * 0.73 * 0.023 / (0.0825 * 0.71)
    np.testing.assert_allclose(np.asarray(push.lines[0].get_ydata()), per_volt * (log.input("V2") + log.input("V3")))
    np.testing.assert_array_equal(speed.lines[0].get_ydata(), log.output("eta1"))
    assert [ax.get_ylabel() for ax in figure.axes] == ["voltage [V]", "F [N]", "eta1 [m/s]"]

    drawn = [np.asarray(line.get_ydata()) for ax in pioneer_figures.figure_3(check).axes for line in ax.lines]
    simulated = check.found.simulated[log.name][:, 0]
    assert any(len(y) == len(simulated) and np.array_equal(y, simulated) for y in drawn)
    assert any(len(y) == len(log) and np.array_equal(y, log.output("eta1")) for y in drawn)

    over, histogram, autocorrelation = pioneer_figures.figure_4(check).axes
    np.testing.assert_array_equal(over.lines[0].get_ydata(), check.found.residuals["eta1"][log.name])
    assert histogram.patches and autocorrelation.lines


def test_the_coupled_model_explains_a_turn_on_the_spot():
    log = read_logs(DEMO / "spot_3_prbs.csv", robot="pioneer")[0]
    across = pioneer_paper.with_caster_across(log)
    assert np.degrees(across.extra["beta"].iloc[0]) == pytest.approx(-99.594, abs=1e-3)
    yaw, ahead, caster = pioneer_figures.turn_on_the_spot(across).axes
    for ax, noise in ((yaw, 0.02), (ahead, NOISE)):
        measured, model = (np.asarray(line.get_ydata()) for line in ax.lines[:2])
        assert np.std(measured - model) == pytest.approx(noise, rel=0.1)
    assert np.min(caster.lines[0].get_ydata()) < -105.0
    # A log whose caster is said to trail is not a turn on the spot from the start.
    assert len(LogSet([across])[0].extra.columns) == 1 and Pioneer().parameters["ym"].value == -0.07
