"""The page and figures of an explanation show what was found, in one file that needs nothing else."""

import re
from dataclasses import replace

import matplotlib.colors as colours
import numpy as np
import pytest
from markupsafe import escape

from jaxid.explanation.next_experiment import NextExperiment
from jaxid.explanation.where.law_curves import LawCurve
from jaxid.explanation.where.shape import Shape
from jaxid.report import explanation_figures as draw
from jaxid.report import explanation_tables as tab
from jaxid.report.explanation_page import PICTURES, figures
from jaxid.report.law_figure import caption, curves_of, law_figure, told
from jaxid.report.leads_figure import leads
from jaxid.report.ranking_figure import ALIKE, OTHER, ranking
from jaxid.robots.effect import in_words
from tests.report.pages import Structure, check

SECTIONS = ["Where?", "What?", "How sure?", "Before and after", "What next?"]


@pytest.fixture(scope="module")
def ambiguous(explained):
    """The same explanation as if a second name were open, with an experiment to settle it."""
    step = explained.search.steps[0]
    other = step.trials[1].id
    found = replace(explained.search, steps=(replace(step, equivalent=(other,)),))
    time = np.arange(100) * 0.02
    between = ("quadratic_drag", other)
    proposed = NextExperiment(between, "with a wave at 2 N", 5.0, 0.4, time, 2 * np.sin(time)[:, None], ("u",))
    effects = (replace(explained.effects[0], equivalent_to=(other,)),)
    return replace(explained, verdict="ambiguous", effects=effects, search=found, next_experiment=proposed)


@pytest.fixture(scope="module")
def unexplained(explained):
    """The same gap as if no candidate had helped."""
    found = replace(explained.search, steps=())
    nothing = {"effects": (), "final": explained.baseline, "after": explained.before}
    return replace(explained, verdict="unexplained", search=found, **nothing)


@pytest.fixture(scope="module")
def adequate(explained):
    """As if the final model had been there from the start."""
    found = replace(explained.search, steps=(), first_look=())
    nothing = {"effects": (), "baseline": explained.final, "before": explained.after, "localisation": None}
    return replace(explained, verdict="adequate", search=found, **nothing)


def saved(found, folder):
    found.save(folder)
    return (folder / "report.html").read_text(encoding="utf-8")


def test_the_page_is_one_file_with_the_verdict_first(explained, tmp_path):
    page = saved(explained, tmp_path)
    assert check(page).sections == [explained.sentence, *SECTIONS]
    assert {path.stem for path in tmp_path.glob("*.png")} == {
        "law", "localisation", "ranking", "before_after", "whiteness", "moved"
    }  # fmt: skip
    for words in (
        explained.localisation.sentence,
        "F = -coefficient v |v|",
        "N s²/m²",
        "in 1 % of cases",
        "runner-up",
        "no pattern is left",
    ):
        assert escape(words) in page, words


@pytest.mark.slow
def test_open_names_are_said_to_be_open_and_settled_next(ambiguous, tmp_path):
    page = saved(ambiguous, tmp_path)
    assert check(page).sections == [ambiguous.sentence, *SECTIONS]
    other = ambiguous.effects[0].equivalent_to[0].replace("_", " ")
    assert f"cannot be told from {other} on this data" in page
    assert (
        ambiguous.next_experiment.sentence in page
        and "Named, but open" in page
        and (tmp_path / "next_experiment.png").exists()
    )


def test_an_unexplained_gap_gives_leads(unexplained, tmp_path):
    page = saved(unexplained, tmp_path)
    assert check(page).sections == [
        unexplained.sentence,
        "Where?",
        "What?",
        "How sure?",
        "The residual",
        "What next?",
    ]
    assert (tmp_path / "leads.png").exists() and not (tmp_path / "moved.png").exists()
    figure = leads(unexplained)
    assert [ax.get_xlabel() for ax in figure.axes] == ["v [m/s or rad/s]", "x [m]", "time [s]"]
    # What the fit cannot absorb of the drag: the true resistance less the fitted one, away from standstill.
    speed, middle = figure.axes[0].lines[1].get_data()
    fitted = unexplained.baseline.robot.parameters.numbers
    missing = (fitted["Fv"] - 2.0) * speed - 1.5 * speed * np.abs(speed) + (fitted["Fc"] - 0.5) * np.sign(speed)
    moving = np.abs(speed) > 0.1
    assert moving.sum() >= 4 and np.ptp(missing[moving]) > 0.3
    np.testing.assert_allclose(middle[moving], missing[moving], atol=0.1)


def test_a_complete_model_has_no_missing_force(adequate, tmp_path):
    page = saved(adequate, tmp_path)
    assert check(page).sections == [adequate.sentence, "How sure?", "The residual", "What next?"]
    assert "No pattern is left: if there were nothing but noise, residuals with at least this much" in page
    assert f"in {100 * adequate.before.p_white:.2g} % of cases" in page and "Nothing missing" in page
    assert set(figures(adequate)) == {"before_after", "whiteness"}


@pytest.mark.slow
def test_a_pattern_too_small_to_matter_is_not_said_to_be_none(adequate, explained, tmp_path):
    small = {"p_white": 1e-6, "normalised_rms": 0.999, "negligible": 1.005}
    before = replace(adequate.before, **small)
    page = saved(replace(adequate, before=before, after=before), tmp_path / "adequate")
    assert "A pattern is left: if there were nothing but noise" in page and "No pattern is left" not in page
    assert "but it is too small beside the noise to matter" in page
    excused = {
        "rounded": "rounding",
        "by_chance": "delays",
        "within_errors": "standard errors",
        "unrelated": "nothing that",
    }
    for k, (why, words) in enumerate(excused.items()):
        found = replace(explained, after=replace(explained.after, p_white=1e-6, normalised_rms=1.2, **{why: True}))
        page = saved(found, tmp_path / str(k))
        assert "After the last step a pattern is left: noise alone" in page and ", but it is " in page and words in page
    residuals = tuple(1.5 * r for r in explained.after.residuals)
    large = replace(explained.after, p_white=0.2, normalised_rms=1.5, noise_error=0.0, residuals=residuals)
    found = replace(explained, after=large)
    assert "After the last step more is left than noise, though without a pattern" in saved(found, tmp_path / "large")


@pytest.mark.slow
def test_a_doubted_fit_is_not_to_be_used(adequate, explained, ambiguous, tmp_path):
    def poor(fit):
        return replace(fit, judgement=fit.judgement.doubted("Drag is missing."))

    for k, (found, badge) in enumerate(
        (
            (replace(adequate, baseline=poor(adequate.baseline)), "Nothing missing, but doubted"),
            (replace(explained, final=poor(explained.final)), "Named, but doubted"),
            (replace(ambiguous, final=poor(ambiguous.final), next_experiment=None), "Named, but doubted"),
        )
    ):
        page = saved(found, tmp_path / str(k))
        assert badge in page and "Use the model" not in page
        assert "--model model.toml --out again" in page
    sound = saved(explained, tmp_path / "sound")
    assert "but doubted" not in sound and "Use the model with what was added" in sound


def test_a_parameter_that_is_not_determined_any_more_is_not_shown_as_if_it_were_exact(explained):
    name = explained.baseline.free_names[0]
    after = explained.final[name]
    open_ = replace(after, std_error=np.inf, ci95=(-np.inf, np.inf), status="not_identifiable")
    final = replace(explained.final, parameters={**explained.final.parameters, name: open_})
    row = next(row for row in tab.moved_table(replace(explained, final=final)).rows if row[0].text == name)
    assert row[3].text == f"{after.value:.4g} (not identifiable)"
    assert [cell.text for cell in row[4:]] == ["-", "-"]
    determined = next(row for row in tab.moved_table(explained).rows if row[0].text == name)
    assert "±" in determined[3].text and "%" in determined[4].text


def test_a_notebook_shows_the_same_body(explained, tmp_path):
    body = explained._repr_html_()
    read = Structure(body)
    assert read.sections == [explained.sentence, *SECTIONS] and not read.tags & {"html", "body", "head", "main"}
    assert all(name in PICTURES for name in figures(explained))


def test_what_users_name_is_escaped(explained):
    named = replace(explained, effects=(replace(explained.effects[0], formula="F < <b>v</b> & w"),))
    body = named._repr_html_()
    assert "<b>v</b>" not in body and "F &lt; &lt;b&gt;v&lt;/b&gt; &amp; w" in body


def test_the_text_fits_a_terminal(explained, ambiguous):
    for found in (explained, ambiguous):
        text = tab.text(found)
        assert text.startswith(found.sentence[:60]) and max(map(len, text.splitlines())) <= 100
        assert "coefficient" in text and "moved" in text
    rows = {row[0].text: [cell.text for cell in row] for row in tab.channel_table(explained).rows}
    assert rows["all"][1] == f"{explained.before.normalised_rms:.2f}"
    assert float(rows["speed v"][2]) == pytest.approx(explained.after.by_channel["v"], abs=0.006)


def test_the_ranking_shows_promises_and_refits(ambiguous):
    figure = ranking(ambiguous)
    bars, refits = figure.axes
    step = ambiguous.search.steps[0]
    shown = [label.get_text() for label in bars.get_yticklabels()]
    by_words = {in_words(c.effect.id): c.effect.id for c in step.screened}
    names = [by_words[words] for words in shown]
    assert "Stribeck friction" in shown and names[: len(step.trials)] == [trial.id for trial in step.trials]
    shares = {c.effect.id: min(max(100 * c.share, 0), 100) for c in step.screened}
    assert [bar.get_width() for bar in bars.patches] == pytest.approx([shares[name] for name in names])
    expected = {names[0]: draw.AFTER, step.equivalent[0]: ALIKE}
    for bar, name in zip(bars.patches, names, strict=True):
        assert colours.same_color(bar.get_facecolor(), expected.get(name, OTHER))
    dots = [line.get_xdata()[0] for line in refits.lines if line.get_marker() == "o"]
    assert dots[0] == step.chosen.held_out.normalised_rms and len(dots) == len(step.trials)
    assert sum(text.get_text() == "not refitted" for text in refits.texts) == len(names) - len(step.trials)


def test_before_and_after_are_the_held_out_residuals(explained):
    figure = draw.before_after(explained)
    e = draw.worst_log(explained)
    worse = [float(np.mean(r**2)) for r in explained.before.residuals]
    assert worse[e] == max(worse)
    error, enlarged = figure.axes
    for line, state in zip(error.lines[::2], (explained.before, explained.after), strict=True):
        np.testing.assert_array_equal(line.get_ydata(), state.residuals[e][:, 0])
    measured, before, after = enlarged.lines
    shown = np.isin(explained.held_out[e].time, measured.get_xdata())
    np.testing.assert_array_equal(measured.get_ydata(), explained.held_out[e].output("v")[shown])
    noise = explained.before.noise["v"]
    for line, state in ((before, explained.before), (after, explained.after)):
        own = (line.get_ydata() - measured.get_ydata()) / noise
        np.testing.assert_allclose(own, state.residuals[e][shown, 0], atol=1e-9)


def test_the_worst_window_is_where_the_error_is():
    residual = np.zeros((500, 2))
    residual[200:260, 1] = 3.0
    begin, end = draw.worst_window(residual, np.arange(500) * 0.02, 2.0)
    assert begin <= 4.0 and end >= 5.18 and end - begin == pytest.approx(2.0)


def test_noise_has_a_flat_spectrum_and_no_correlation():
    rng = np.random.default_rng(8)
    parts = [rng.normal(size=20000) for _ in range(3)]
    frequency, power = draw.spectrum(parts, 0.02)
    assert frequency[-1] == pytest.approx(25.0) and power.mean() == pytest.approx(1.0, abs=0.02)
    assert power.min() > 0.85 and power.max() < 1.15
    rho = draw.correlation(parts)
    assert rho[0] == 1.0 and np.abs(rho[1:]).max() < 4 / 60000**0.5
    # An AR(1) residual: correlation a^k, and the closed form of its spectrum.
    coloured = np.zeros(60000)
    for k, e in enumerate(rng.normal(size=59999)):
        coloured[k + 1] = 0.8 * coloured[k] + e
    np.testing.assert_allclose(draw.correlation([coloured])[:5], 0.8 ** np.arange(5), atol=0.03)
    frequency, power = draw.spectrum([coloured], 0.02)
    exact = 1 / np.abs(1 - 0.8 * np.exp(-2j * np.pi * frequency * 0.02)) ** 2
    assert np.median(power / exact) == pytest.approx(1.0, abs=0.03)


def test_parameters_stand_where_they_were_relative_to_the_larger(explained):
    figure = draw.moved(explained)
    (ax,) = figure.axes
    names = [label.get_text() for label in ax.get_yticklabels()]
    dots = [line for line in ax.lines if line.get_marker() == "o"]
    assert names == list(explained.moved) and len(dots) == 2 * len(names)
    for name, before, after in zip(names, dots[::2], dots[1::2], strict=True):
        old, new = (e.value for e in explained.moved[name])
        assert before.get_xdata()[0] == pytest.approx(100 * (old - new) / max(abs(old), abs(new)))
        assert after.get_xdata()[0] == 0.0


def test_the_first_picture_says_what_is_missing_to_who_sees_it_and_who_does_not(explained, tmp_path):
    page = saved(explained, tmp_path)
    size = explained.effects[0].parameters["coefficient"].value
    curves = curves_of(explained)
    (curve,) = curves["quadratic_drag"]
    fastest = float(curve.values[-1])
    words = caption(explained, curves)
    assert words.startswith("Quadratic drag: force on the speed v falls by ")
    assert float(re.search(r"falls by ([\d.]+) N", words)[1]) == pytest.approx(size * fastest**2, rel=0.01)
    # Half of a square is at the root of a half.
    half = float(re.search(r"half of that at ([\d.]+) ", words)[1])
    assert half == pytest.approx(fastest / 2**0.5, abs=0.02)
    assert page.index(f'aria-label="{escape(words)}"') < page.index("<h2>Where?")
    assert f"<figcaption>{escape(words)} " in page
    (ax,) = law_figure(curves).axes
    assert ax.get_xlabel() == "speed v [m/s or rad/s]" and ax.get_ylabel() == "force [N]"


def test_the_law_of_an_effect_is_said_and_those_that_are_as_good(explained):
    shape = Shape("", "|v|", "m/s", "N", (0.0, 1.0), (0.0, 2.5), ((0.0, 0.0), (2.4, 2.6)))
    alike = replace(explained, effects=(replace(explained.effects[0], law="power", laws_alike=("cubic", "tanh")),))
    curve = replace(explained, effects=(replace(explained.effects[0], law="shape", laws_alike=(), shapes=(shape,)),))
    page, text = alike._repr_html_(), " ".join(tab.text(alike).split())
    assert "Of its laws, power cannot be told from cubic or tanh on this data" in page
    assert "by the law power (or cubic, tanh, which this data cannot tell apart)" in text
    for said in (curve._repr_html_(), " ".join(tab.text(curve).split())):
        assert "this curve of |v|: 0 N at 0 m/s, 2.5 N at 1 m/s" in said


def curve_of(change, x=None, **fields):
    """A curve that an effect of that `change` makes of zero."""
    x = np.linspace(-1.0, 1.0, 4000) if x is None else x
    own = {"effect": "e", "quantity": "friction", "part": "", "unit": "N", "variable": "speed", "of": "m/s"}
    values = np.sign(x) * np.broadcast_to(change(np.abs(x)), x.shape)
    return LawCurve(**(own | fields), values=x, before=0 * x, after=values, change=values, std=0 * x)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            lambda s: 0.31 * np.exp(-((s / 0.06) ** 2)),
            "friction rises by 0.310 N near 0 m/s, by half of that at speed 0.050 m/s",
        ),
        (lambda s: 2.0 * s, "friction rises by 2 N at speed 1.0 m/s, by half of that at 0.50 m/s"),
        (lambda s: -0.5, "friction is lower by 0.500 N throughout"),
    ],
)
def test_curves_are_told_by_their_size_and_where_half_of_it_is(change, expected):
    assert told(curve_of(change)).replace("2.00 N", "2 N") == expected


def test_several_effects_on_one_curve_share_a_panel():
    one, other = curve_of(lambda s: s), curve_of(lambda s: s**2)
    figure = law_figure(
        {"traction_limit": (one,), "sensor_bias": (replace(one, effect="sensor_bias"),), "other": (other,)}
    )
    titles = [ax.get_title(loc="left") for ax in figure.axes if ax.get_visible()]
    assert titles == ["Traction limit and sensor bias: friction", "Other: friction"]
    assert law_figure({}) is None


@pytest.mark.parametrize(
    ("x", "drawn"),
    [
        (np.linspace(-0.9, 0.9, 500), True),
        (np.where(np.arange(500) % 3, np.nan, np.linspace(-0.9, 0.9, 500)), True),  # a camera's cells, mostly empty
        (np.zeros(500), False),
        (np.full(500, np.nan), False),
        (np.zeros(0), False),
    ],
)
def test_measured_values_are_drawn_where_their_variable_was_seen_to_change(x, drawn):
    """Of a heading that no sensor told the page had ended in a traceback."""
    curve = replace(curve_of(lambda s: s, variable="heading"), samples=(x, 2.0 * x))
    (ax,) = law_figure({"ground_slope": (curve,)}).axes
    dots = [line for line in ax.lines if line.get_marker() == "o"]
    assert bool(dots) == drawn
    for line in dots:
        np.testing.assert_allclose(line.get_ydata(), 2.0 * np.asarray(line.get_xdata()), atol=1e-9)


def test_a_change_too_small_to_be_seen_beside_the_whole_is_drawn_alone():
    x = np.linspace(-10.0, 10.0, 4000)
    lost = curve_of(lambda s: -0.02 * s, x)
    lost = replace(lost, before=x, after=x + lost.change, quantity="what reaches the motor")
    (ax,) = law_figure({"motor_gain_mismatch": (lost,)}).axes
    assert ax.get_ylabel() == "change of what reaches the motor [N]"
    before, after = (line.get_ydata() for line in ax.lines[:2])
    np.testing.assert_allclose(before, 0.0)
    np.testing.assert_allclose(after, -0.02 * x, atol=1e-12)
