"""jaxid/report/chart.py: what is drawn is what was given, in the page's square."""

import re

import numpy as np
import pytest

from jaxid.report.chart import Chart, Panel, Trace, reach_of, stretches, thinned, ticks


def walked(data):
    """The points of a path, by its letters."""
    x = y = 0
    points = []
    for letter, rest in re.findall(r"([MmlhvHV])([^MmlhvHVz]*)", data):
        n = [int(k) for k in re.findall(r"-?\d+", rest)]
        if letter == "M":
            x, y = n
        elif letter == "m":
            x, y = x + n[0], y + n[1]
        elif letter == "l":
            for dx, dy in zip(n[:-2:2], n[1:-2:2], strict=True):
                x, y = x + dx, y + dy
                points.append((x, y))
            x, y = x + n[-2], y + n[-1]
        elif letter == "H":
            x = n[0]
        elif letter == "V":
            y = n[0]
        elif letter == "h":
            x += n[0]
        elif letter == "v":
            y += n[0]
        points.append((x, y))
    return np.array(points)


def chart_of(trace, **fields):
    return Chart((Panel("v [m/s]", (trace,), -2.0, 2.0, **fields),), alt="a line")


@pytest.mark.parametrize("style", ["line", "dots", "dashed"])
def test_a_path_has_every_point_where_it_belongs(style):
    rng = np.random.default_rng(3)
    x, y = np.sort(rng.uniform(3.0, 9.0, 200)), rng.uniform(-2.0, 2.0, 200)
    y[[50, 51, 120]] = np.nan
    chart = chart_of(Trace(x, y, "c0", "v", style))
    (drawn,) = chart.drawn
    points = np.unique(walked(drawn.paths[0][0]), axis=0)
    there = np.isfinite(y)
    assert len(points) == there.sum()
    found_x = x[0] + points[:, 0] / 100_000 * (x[-1] - x[0])
    found_y = 2.0 - points[:, 1] / 10_000 * 4.0
    np.testing.assert_allclose(found_x, x[there], atol=1e-4)
    np.testing.assert_allclose(found_y, y[there], atol=3e-4)
    assert drawn.paths[0][0].count("M") == (3 if style != "dots" else 0)  # a line breaks where nothing was measured


def test_steps_hold_their_value_until_the_next_sample():
    (drawn,) = chart_of(Trace(np.array([0.0, 1.0, 2.0]), np.array([-2.0, 2.0, 0.0]), "input", "", "step")).drawn
    assert drawn.paths[0][0] == "M0 10000h50000v-10000h50000v5000"


def test_long_lines_keep_their_peaks_in_order():
    x = np.arange(200_000.0)
    y = np.sin(x / 500)
    y[123_456] = 7.0
    short_x, short_y = thinned(x, y, 2000)
    assert len(short_x) <= 2000 and np.all(np.diff(short_x) > 0)
    assert short_y.max() == 7.0 and short_x[short_y.argmax()] == 123_456 and short_y.min() < -0.999
    same = thinned(x[:2000], y[:2000], 2000)
    assert same[0] is not None and len(same[0]) == 2000
    assert chart_of(Trace(x, y, "c0")).thinned and not chart_of(Trace(x[:9], y[:9], "c0")).thinned


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.0, 10.0, ["0", "2", "4", "6", "8", "10"]),
        (-0.03, 0.03, ["−0.03", "−0.02", "−0.01", "0", "0.01", "0.02", "0.03"]),
        (-11.0, 11.0, ["−10", "−5", "0", "5", "10"]),
        (5.0, 15.0, ["6", "8", "10", "12", "14"]),
        (0.0, 1e-6, ["0", "2e−7", "4e−7", "6e−7", "8e−7", "1e−6"]),
    ],
)
def test_ticks_are_round_numbers_with_digits_that_tell_them_apart(low, high, expected):
    assert [text for text, _ in ticks(low, high)] == expected


def test_a_scale_has_at_least_two_numbers():
    rng = np.random.default_rng(0)
    for low, size in zip(rng.normal(0, 10, 300), 10.0 ** rng.uniform(-4, 4, 300), strict=True):
        for most in (3, 4, 6):
            shown = ticks(low, low + size, most)
            assert 2 <= len(shown) <= most + 2 and len({text for text, _ in shown}) == len(shown)
            assert all(low - 1e-9 * size <= at <= low + size * (1 + 1e-9) for _, at in shown)


def test_marked_stretches_and_bands_lie_where_they_were_given():
    t = np.arange(11.0)
    assert stretches(np.isin(t, (2.0, 3.0, 7.0)), t) == ((2.0, 3.0), (7.0, 7.0))
    trace = Trace(t, np.zeros(11), "c0")
    bands = ((t, np.full(11, -1.0), np.full(11, 1.0), "c0"),)
    (drawn,) = chart_of(trace, marked=((2.0, 3.0),), bands=bands, level=0.5).drawn
    assert drawn.marked == [(20_000, 10_000)]
    noise, own = (walked(data) for data, _ in drawn.bands)
    assert {3750, 6250} == set(noise[:, 1]) and {2500, 7500} == set(own[:, 1])


def test_a_quantity_that_never_changes_and_one_never_measured_can_be_drawn():
    for y in (np.full(5, 3.0), np.full(5, np.nan), np.zeros(5)):
        (drawn,) = Chart((Panel("v", (Trace(np.arange(5.0), y, "c0"),)),), alt="v").drawn
        assert drawn.high > drawn.low and len(drawn.y_ticks) >= 2


def test_panels_of_residuals_hold_nearly_all_of_them():
    e = np.random.default_rng(1).normal(size=5000)
    e[7] = 100.0
    assert 3.0 < reach_of([e], 1.0) < 5.0
    assert reach_of([e], 10.0) == pytest.approx(11.5) and reach_of([100 * e], 1.0, 20.0) == pytest.approx(23.0)
