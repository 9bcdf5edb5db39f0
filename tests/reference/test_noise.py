"""Each kind of noise against its own statistics."""

import numpy as np
import pytest
from scipy import stats

from reference.axis import AXIS
from reference.logs import simulate_log
from reference.noise import DEGREES, JITTER, KINDS, OUTLIERS, POLE, SIZE, STEP, added, jittered

SIGMA = np.array([0.01, 0.02])


def drawn(kind: str, n: int = 40000) -> np.ndarray:
    """Noise on slowly growing speeds, in standard deviations."""
    speeds = np.linspace(0.0, 3.0, n)[:, None] * np.ones(2)
    return (added(speeds, SIGMA, kind, np.random.default_rng(5)) - speeds) / SIGMA


def test_white_noise_is_what_numpy_draws():
    speeds = np.ones((7, 2))
    expected = speeds + np.random.default_rng(3).standard_normal((7, 2)) * SIGMA
    np.testing.assert_array_equal(added(speeds, SIGMA, "white", np.random.default_rng(3)), expected)


@pytest.mark.parametrize("kind", ["white", "coloured", "heavy_tailed"])
def test_unit_variance(kind):
    assert drawn(kind).std(axis=0) == pytest.approx([1.0, 1.0], abs=0.06)


def test_coloured_noise_remembers_and_starts_like_it_goes_on():
    noise = drawn("coloured")[:, 0]
    lags = [np.corrcoef(noise[k:], noise[: len(noise) - k])[0, 1] for k in (1, 2, 3)]
    assert lags == pytest.approx([POLE, POLE**2, POLE**3], abs=0.03)
    firsts = [added(np.zeros((2, 1)), np.ones(1), "coloured", np.random.default_rng(k))[0, 0] for k in range(3000)]
    assert np.std(firsts) == pytest.approx(1.0, abs=0.05)


def test_heavy_tails_are_students():
    scaled = drawn("heavy_tailed")[:, 0] * np.sqrt(DEGREES / (DEGREES - 2.0))
    assert stats.kstest(scaled, stats.t(DEGREES).cdf).pvalue > 0.01


def test_outliers_are_few_and_large():
    noise = np.abs(drawn("outliers"))
    expected = OUTLIERS * 2 * stats.norm.sf(6.0 / np.hypot(SIZE, 1.0))
    assert np.mean(noise > 6.0) == pytest.approx(expected, rel=0.2)
    assert np.median(noise) == pytest.approx(stats.norm.ppf(0.75), abs=0.02)


def test_quantised_readings_are_whole_steps():
    speeds = np.linspace(-1.0, 1.0, 999)[:, None] * np.ones(2)
    steps = added(speeds, SIGMA, "quantised", np.random.default_rng(1)) / (STEP * SIGMA)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert drawn("quantised").std() == pytest.approx(np.sqrt(STEP**2 / 12 + 0.3**2), rel=0.03)


def test_jittered_stamps_stay_in_order():
    time = np.arange(5000) * 0.02
    stamps = jittered(time, np.random.default_rng(2))
    assert stamps[0] == 0.0 and (np.diff(stamps) > 0).all()
    assert (stamps - time).std() == pytest.approx(JITTER * 0.02, rel=0.05)


def test_a_log_has_the_kind_that_was_asked_for():
    inputs = np.full((500, 1), 3.0)
    tables = {kind: simulate_log(AXIS, inputs, 0.02, 0.01, seed=4, noise_kind=kind) for kind in KINDS}
    for kind in KINDS[1:]:
        assert not tables[kind][["t", "v"]].equals(tables["white"][["t", "v"]])
    assert tables["jittered"]["v"].equals(tables["white"]["v"])
    with pytest.raises(ValueError, match="Unknown kind of noise 'pink'"):
        simulate_log(AXIS, inputs, 0.02, 0.01, noise_kind="pink")
