"""jaxid/report/comparison.py with its tables and figures: contents against the demonstration logs' known truth."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import jaxid
from jaxid.estimate.result import NORMAL_95, Estimate, Fit
from jaxid.report import tables
from jaxid.report.comparing import compare
from jaxid.report.figures import Ratio, parameters
from tests.closed_form_rover import driven, rover

DEMO = Path(__file__).parents[2] / "jaxid/demo_logs/pioneer"
TRUTH = tomllib.loads((DEMO / "truth.toml").read_text())


def fit_of(method, robot, relative_error=0.01, **changed):
    """A fit as an estimator would return it: the robot's own numbers as estimates."""
    free = robot.parameters.free_names
    found = {
        name: Estimate.of(p.value, relative_error * abs(p.value) if name in free else np.nan, p.unit, status)
        for name, p in robot.parameters.items()
        for status in ["identified" if name in free else "fixed"]
    }
    numbers = robot.parameters.numbers
    combined = {
        name: Estimate.of(float(function(numbers)), relative_error * float(function(numbers)), unit)
        for name, (function, unit, _) in robot.combinations.items()
    }
    covariance = np.diag([(relative_error * numbers[name]) ** 2 for name in free])
    return Fit(method, robot, found | changed, combined, free, covariance, {}, True, "converged", 3)


@pytest.fixture(scope="module")
def held_out():
    return jaxid.LogSet(log.window(0, 12) for log in jaxid.read_logs(DEMO / "check_*.csv", robot="pioneer"))


@pytest.fixture(scope="module")
def fits():
    wrong = jaxid.Pioneer().with_values(Cs=0.40, Cv=0.040)
    lost = Estimate.of(1.072e-4, np.nan, "kg m^2", "not_identifiable")
    return fit_of("integral_least_squares", wrong, Ip1=lost), fit_of(
        "output_error", jaxid.Pioneer().with_values(**TRUTH)
    )


@pytest.fixture(scope="module")
def comparison(fits, held_out):
    return compare(*fits, held_out=held_out, truth=TRUTH)


def test_the_truth_reaches_the_noise_floor_and_a_wrong_model_does_not(comparison):
    ls, oe = (comparison.predicted[label] for label in ("integral_least_squares", "output_error"))
    # The noise is 0.01 m/s and 0.02 rad/s (demo_logs/README.md).
    assert oe.rms == pytest.approx({"eta1": 0.01, "eta2": 0.02}, rel=0.06)
    # The noise floor comes from the logs, to a few per cent.
    assert oe.normalised_rms == pytest.approx(1.0, abs=0.06)
    assert not any(test.rejected for tests in oe.tests.values() for test in tests.all)
    assert ls.normalised_rms > 1.5 and ls.tests["eta1"].whiteness.rejected
    assert oe.fit_percent["eta1"] > ls.fit_percent["eta1"]


def test_parameters_side_by_side(comparison):
    table = comparison.parameters
    assert table.loc["Cs", ("integral_least_squares", "value")] == 0.40
    assert table.loc["Cs", ("", "true")] == TRUTH["Cs"] and table.loc["Cs", ("", "unit")] == "N m"
    assert table.loc["Cs", ("integral_least_squares", "error_percent")] == pytest.approx(100 * (0.4 / 0.3184 - 1))
    assert table.loc["Cs", ("output_error", "error_percent")] == pytest.approx(0.0, abs=1e-9)
    assert table.loc["Cs", ("output_error", "ci95_high")] == pytest.approx(0.3184 * (1 + NORMAL_95 * 0.01))
    assert table.loc["Ip1", ("integral_least_squares", "status")] == "not_identifiable"
    # Combinations stand below, with the truth's own value: equation 34 in the constants of truth.toml.
    mass = TRUTH["M"] + 2 * TRUTH["m"] + TRUTH["m1"] + TRUTH["Ir1"] / TRUTH["R1"] ** 2
    mass += 2 * TRUTH["Ir"] / TRUTH["R"] ** 2
    assert list(table.index[-2:]) == ["1/a11", "1/a22"]
    assert table.loc["1/a11", ("", "true")] == pytest.approx(mass, rel=1e-12)
    # What is fixed, the same everywhere and true needs no row.
    assert "KT" not in table.index


def test_published_values_stand_in_for_an_unknown_truth(fits, held_out):
    table = compare(fits[1], held_out=held_out).parameters
    assert table.loc["Cs", ("", "published")] == 0.3184
    assert ("", "true") not in table.columns


def test_published_values_do_not_stand_beside_those_of_a_robot_that_is_another(fits, held_out):
    heavy = replace(fits[1], robot=fits[1].robot.with_values(M=200.0))
    found = compare(heavy, held_out=held_out)
    assert found.references == {} and "error is relative" not in repr(found)
    # Of a true value that is given, the owner's constants and not the paper's make the combinations.
    known = compare(heavy, held_out=held_out, truth={"Ir1": 0.0}).references["1/a11"]
    assert known > 200.0


def test_check_table_and_tests(comparison):
    table = comparison.held_out
    assert list(table.index) == ["integral_least_squares", "output_error"]
    row, v = table.loc["output_error"], comparison.predicted["output_error"]
    assert row["normalised_rms"] == v.normalised_rms
    assert row["fit_percent eta2"] == v.fit_percent["eta2"]
    assert {f"normalised_rms {log.name}" for log in comparison.logs} <= set(table.columns)
    # two methods x two channels x (whiteness, two inputs, normality)
    assert len(comparison.tests) == 16 and comparison.tests["sentence"].str.len().min() > 20


def test_the_sentence_names_the_better_method_and_the_culprit(comparison):
    level = comparison.predicted["integral_least_squares"].normalised_rms
    assert comparison.sentence.startswith("Output error predicts the held-out logs to ")
    assert f"integral least squares to {level:.2f} times" in comparison.sentence
    assert "differ most in Cs (0.3184 against 0.4000 N m" in comparison.sentence
    # |0.4 - 0.3184| / hypot(1 % of each)
    assert f"{(0.4 - 0.3184) / np.hypot(0.004, 0.003184):.1f} combined standard errors" in comparison.sentence


def test_equal_fits_are_called_equal_and_numbered(fits, held_out):
    same = compare(fits[1], fits[1], held_out=held_out)
    assert list(same.fits) == ["output_error 1", "output_error 2"]
    assert "no difference that counts" in same.sentence and "agrees within 2 combined" in same.sentence


def test_text_fits_a_terminal_and_tells_everything(comparison):
    text = repr(comparison)
    assert max(map(len, text.splitlines())) <= 100
    assert "\x1b" not in text and "…" not in text
    for words in ("0.3184 ± 0.0032", "0.4000 ± 0.0040", "+25.6 %", "identifiable)", "check_crawl", "noise floor"):
        assert words in text
    assert re.sub(r"\s+", " ", text).startswith(comparison.sentence)


def test_three_methods_still_fit_a_terminal(fits, held_out):
    text = repr(compare(*fits, replace(fits[0], method="recursive_least_squares"), held_out=held_out, truth=TRUTH))
    assert max(map(len, text.splitlines())) <= 100 and "…" not in text
    assert "Errors of the parameters" in text


def test_html_carries_tables_and_figures(comparison):
    page = comparison._repr_html_()
    for words in (*comparison.parameters.index, "0.3184 ± 0.0032", "0.0001072 (not identifiable)", "noise floor"):
        assert f">{words}" in page
    assert page.count('<figure class="chart"') == len(comparison.logs) and "<img" not in page
    assert page.count("<table") == page.count("</table>") == 4
    assert "Coulomb friction of a driving wheel" in page and ">N m</td>" in page
    words = re.sub(r"<(style|script)>.*?</\1>", "", page, flags=re.S)
    assert "http" not in words and ">nan<" not in words  # nothing from elsewhere, no unexplained blanks


def test_names_from_files_are_escaped(fits, held_out):
    odd = jaxid.Log("<b>.csv", held_out[0].time, held_out[0].inputs, held_out[0].outputs, held_out.channels)
    page = compare(fits[1], held_out=odd)._repr_html_()
    assert "<b>.csv" not in page and "&lt;b&gt;.csv" in page


def test_intervals_of_a_doubtful_fit_are_dotted():
    ratios = {"M": {"integral_least_squares": Ratio(1.1, 1.05, 1.15), "output_error": Ratio(1.0, 0.95, 1.05)}}
    (axes,) = parameters(ratios, "true value", doubtful=["integral_least_squares"]).axes
    dotted = {line.get_label(): line.get_linestyle() == ":" for line in axes.lines if line.get_label()[0] != "_"}
    assert dotted == {"integral least squares (may not hold)": True, "output error": False}
    drawn = [line.get_linestyle() for line in axes.lines if list(line.get_xdata()) == [1.05, 1.15]]
    assert drawn == [":"]


def test_figures_and_files(comparison, tmp_path):
    found = comparison.figures()
    names = [f"response_{log.name}" for log in comparison.logs]
    assert list(found) == [re.sub(r"[^\w.-]+", "_", n) for n in names] + [
        "residuals_eta1",
        "residuals_eta2",
        "parameters",
    ]
    assert all(isinstance(figure, Figure) for figure in found.values())
    response = next(iter(found.values()))
    assert [ax.get_ylabel() for ax in response.axes] == [
        "input [V]",
        "eta1 [m/s]",
        "residual\n[m/s]",
        "eta2 [rad/s]",
        "residual\n[rad/s]",
    ]
    # Methods keep their colours from figure to figure.
    lines = {line.get_label(): line.get_color() for line in response.axes[1].lines}
    other = {line.get_label(): line.get_color() for line in found["parameters"].axes[0].lines}
    assert next(c for n, c in lines.items() if n.startswith("output error")) == other["output error"]
    page, *paths = comparison.save(tmp_path / "new")
    assert page.name == "report.html" and page.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert [path.stem for path in paths] == list(found)
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)


def test_pyplot_is_not_involved(comparison):
    import matplotlib._pylab_helpers as helpers

    before = len(helpers.Gcf.figs)
    comparison.figures()
    assert len(helpers.Gcf.figs) == before


def test_the_residual_figure_draws_the_residual(comparison):
    axes = comparison.figures()["residuals_eta1"].axes
    drawn = np.concatenate([line.get_ydata() for line in axes[3].lines])
    own = np.concatenate(list(comparison.predicted["output_error"].residuals["eta1"].values()))
    np.testing.assert_array_equal(drawn, own)


def growing(state, inputs, p):
    return {"v": p["k"] * state["v"] + inputs["u"]}


def unstable(rate):
    return jaxid.Custom(
        dynamics=growing,
        state_names=("v",),
        own_channels=jaxid.Channels(inputs=("u",), outputs=("v",)),
        table={"k": jaxid.Parameter(rate, "1/s", free=True)},
    )


def test_a_simulation_that_diverges_is_reported_for_its_log_alone():
    random, t = np.random.default_rng(5), 0.01 * np.arange(1001)
    robot = unstable(-2.0)
    # At rest without input; and a step, whose response is (1 - exp(-2 t)) / 2.
    rest = 0.01 * random.normal(size=1001)
    step = (1 - np.exp(-2 * t)) / 2 + 0.01 * random.normal(size=1001)
    logs = jaxid.LogSet(
        jaxid.Log.from_arrays(name, t, u, y, robot)
        for name, u, y in (("rest.csv", np.zeros(1001), rest), ("step.csv", np.ones(1001), step))
    )
    found = compare(fit_of("integral_least_squares", unstable(80.0)), fit_of("output_error", robot), held_out=logs)
    assert found.predicted["integral_least_squares"].diverged == ("step.csv",)
    assert found.predicted["output_error"].rms["v"] == pytest.approx(0.01, rel=0.05)
    assert not found.predicted["output_error"].diverged
    assert found.sentence.endswith("integral least squares diverges on step.csv.")
    assert found.worst_log == "step.csv"
    text = re.sub(r"\s+", " ", repr(found))
    assert "the simulation diverges on step.csv; its numbers leave that log out" in text
    page = found._repr_html_()
    assert page.count("diverges") >= 2 and "on 1 of 2 logs" in page


def test_both_sides_and_logs_that_were_fitted(fits, held_out):
    found = compare(fits[1], held_out=held_out[:2], fit=held_out[1:])
    assert found.fitted["output_error"].normalised_rms == pytest.approx(1.0, abs=0.06)
    assert "normalised_rms (fitted logs)" in found.held_out.columns
    assert [note.split(" ")[0] for note in found.notes if "also fitted" in note] == [held_out[1].name]


def test_notes_of_the_estimators_are_passed_on(fits, held_out):
    slow = replace(fits[1], converged=False, reason="not converged in 3 steps", notes=("Read this.",))
    text = re.sub(r"\s+", " ", repr(compare(slow, held_out=held_out)))
    assert "Note: output error: not converged in 3 steps." in text and "Note: output error: Read this." in text


def test_bad_requests(fits, held_out):
    with pytest.raises(ValueError, match="give at least one fit"):
        compare(held_out=held_out)
    other = jaxid.read_logs(DEMO.parent / "omni/check_multilevel.csv", robot="omni")
    with pytest.raises(
        jaxid.LogError, match="check_multilevel.csv has the channels .* compare with logs of that robot"
    ):
        compare(*fits, held_out=other)


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.31841, 0.00123, "0.3184 ± 0.0012"),
        (29.45, 1.2, "29.4 ± 1.2"),
        (17.0776, np.nan, "17.08"),
        (2.144e-4, 3.1e-6, "(2.144 ± 0.031)e-4"),
        (123.0, 45.0, "123 ± 45"),
        (0.0, 0.02, "0.000 ± 0.020"),
        (np.nan, 0.1, "-"),
        (1.9463e92, 2.4e3, "1.946e+92 ± 2.4e+03"),  # of a fit that diverged
        (1.9463e92, 2.4e85, "(1.94630000 ± 0.00000024)e92"),
    ],
)
def test_numbers_with_errors(value, error, text):
    assert tables.with_error(value, error) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.352, "+0.35 %"), (-12.34, "-12.3 %"), (5678.0, "+5678 %"), (6.4878e91, "+6.5e+91 %"), (np.nan, "-")],
)
def test_shares(value, text):
    assert tables.percent(value) == text


def test_what_a_slower_sensor_repeats_in_a_held_out_log_is_no_reading():
    """A speed that is refreshed at every eighth row: by its repeats the right model would miss the log by many times."""

    def held(k, y):
        return np.stack([np.repeat(y[::8, 0], 8)[: len(y)], y[:, 1]], axis=1) if k == 2 else y

    logs, held_out = driven(3, count=2, change=held)
    fit = jaxid.output_error(rover(), logs)
    found = compare(fit, held_out=jaxid.LogSet(list(held_out)[:1]))
    (seen,) = found.predicted.values()
    assert seen.normalised_rms < 1.1
    (note,) = [note for note in found.notes if "tell nothing of the motion" in note]
    assert "what V, whose sensor is slower than the logs, repeats" in note
    assert not any("misses the held-out logs" in note for note in found.notes)


def test_other_logs_are_predicted_with_the_clocks_that_were_found(axis_log):
    """Of two clocks 60 ms apart: as well as the noise is, and not as far off as the clocks make them."""
    robot = jaxid.Axis().with_values(M=1.0, Fv=2.0, Fc=0.5).change("offset", free=False)
    inputs, rng, logs = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 50), np.random.default_rng(1), []
    for k in range(3):
        own = axis_log(f"run {k}", np.roll(inputs, 100 * k), position=False, M=1.0, Fv=2.0, Fc=0.5)
        v = own.output("v")[3:] + 0.005 * rng.normal(size=len(own) - 3)
        logs.append(jaxid.Log.from_arrays(own.name, own.time[:-3], own.inputs[:-3], {"v": v}, own.channels))
    fit = jaxid.output_error(robot, jaxid.LogSet(logs[:2]), clock_offset=True)
    found = compare(fit, held_out=logs[2], fit=jaxid.LogSet(logs[:2]))
    assert all(abs(offset.value - 0.06) < 0.004 for offset in fit.clock_offsets.values())
    assert max(own["output_error"].normalised_rms for own in (found.predicted, found.fitted)) < 1.3
    assert any("inputs' clock" in note for note in found.notes), found.notes
    blind = compare(jaxid.output_error(robot, jaxid.LogSet(logs[:2])), held_out=logs[2])
    assert blind.predicted["output_error"].normalised_rms > 3.0


def test_logs_that_a_fit_remembers_are_no_unseen_ones_though_no_one_says_that_they_were_fitted(axis_log):
    force = np.repeat([3.0, -2.0, 4.0, -3.5, 1.5, -4.0], 40)
    logs = jaxid.LogSet([axis_log(name, way * force, noise=0.01, seed=3) for name, way in (("a", 1.0), ("b", -0.8))])
    fit = jaxid.integral_least_squares(jaxid.Axis(), logs[:1])
    notes = compare(fit, held_out=logs).notes
    assert [note.split(" ")[0] for note in notes if "also fitted" in note] == ["a"]
