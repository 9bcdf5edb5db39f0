"""jaxid/estimate/posterior.py: NUTS against a density computed on a grid, and the role of bounds and priors."""

import sys
import warnings

import numpy as np
import pytest

from jaxid import Axis, Integrator, LogSet, load, output_error, posterior, save

pytest.importorskip("blackjax", reason="the posterior needs blackjax (extra `posterior`)")
TRUE = {"M": 1.0, "Fv": 2.0, "Fc": 0.0}
ROBOT = Axis().change("offset", free=False).with_values(**TRUE).change("Fc", free=False)
STEP = Integrator(2)


@pytest.fixture(scope="module")
def logs(axis_log):
    inputs = np.repeat([1.5, -1.0, 0.8], 12)
    return LogSet([axis_log("a", inputs, noise=0.04, seed=4, position=False, **TRUE)])


@pytest.fixture(scope="module")
def drawn(logs):
    """Few draws of a posterior, its Fv bounded below."""
    fit = output_error(ROBOT.change("Fv", lower=2.0), logs, integrator=STEP)
    return posterior(fit, logs, integrator=STEP, draws=300, warmup=150, seed=3)


def arviz():
    """ArviZ, which announces its next version once a day when it is imported."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        return pytest.importorskip("arviz", reason="to_arviz needs ArviZ (extra `arviz`)")


@pytest.mark.slow
def test_arviz_finds_the_same_numbers_in_the_same_draws(drawn):
    """r_hat as Gelman and Rubin defined it (ArviZ: "identity"), effective draws after Geyer, whose chains ArviZ halves."""
    az = arviz()
    found = drawn.to_arviz()
    assert set(found.groups()) == {"posterior", "sample_stats"}
    assert found.posterior["M"].attrs["units"] == "kg" and found.posterior["M"].attrs["long_name"]
    assert dict(found.posterior.sizes) == {"chain": 4, "draw": 300}
    assert int(found.sample_stats["diverging"].sum()) == drawn.divergences
    r_hat, effective = az.rhat(found, method="identity"), az.ess(found, method="mean")
    for name, draws in drawn.samples.items():
        assert np.array_equal(found.posterior[name], draws)
        assert float(r_hat[name]) == pytest.approx(drawn.r_hat[name], abs=1e-3)
        assert float(effective[name]) == pytest.approx(drawn.effective[name], rel=0.15)
    assert "Fv" in az.summary(found).index


def test_a_posterior_is_saved_with_its_seed_and_draws(drawn, tmp_path):
    found = load(save(drawn, tmp_path / "posterior.jaxid"))
    assert repr(found) == repr(drawn) and np.array_equal(found.samples["M"], drawn.samples["M"])
    assert (
        found.origin.arguments["seed"] == 3
        and found.origin.arguments["fit"].robot == drawn.origin.arguments["fit"].robot
    )


@pytest.mark.parametrize(("package", "method"), [("arviz", "to_arviz"), ("xarray", "to_xarray")])
def test_an_extra_that_is_not_installed_is_named(drawn, package, method, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError, match=rf"pip install jaxid-robots\[{package}\]"):
        getattr(drawn, method)()


def test_moments_and_quantiles_are_those_of_the_density_on_a_grid(drawn, logs):
    """Twelve noisy samples a level, and a bound that cuts the posterior in the middle."""
    lower, found = 2.0, drawn
    fit = found.origin.arguments["fit"]
    M, Fv = np.linspace(0.6, 1.6, 40), np.linspace(lower, 3.2, 50)
    sigma, measured = fit.noise["v"], logs[0].output("v")

    # Without dry friction a held input makes the speed an exponential: v' = v e + (1 - e) u / Fv, e = exp(-Fv h / M).
    decay = np.exp(-Fv / M[:, None] * logs[0].sampling_interval)
    v, log_density = np.zeros_like(decay), np.zeros_like(decay)
    for seen, (u,) in zip(measured, logs[0].inputs, strict=True):
        log_density -= 0.5 * ((v - seen) / sigma) ** 2
        v = decay * v + (1 - decay) * u / Fv
    density = np.exp(log_density - log_density.max())
    for name, grid, marginal in (("M", M, density.sum(axis=1)), ("Fv", Fv, density.sum(axis=0))):
        share = marginal / marginal.sum()
        mean = float(share @ grid)
        deviation = float(np.sqrt(share @ (grid - mean) ** 2))
        draws = found.samples[name]
        assert draws.shape == (4, 300) and found.effective[name] > 200 and found.r_hat[name] < 1.05
        assert draws.mean() == pytest.approx(mean, abs=0.2 * deviation)
        assert draws.std() == pytest.approx(deviation, rel=0.15)
        # The 10 % quantile of 200 independent draws is known to 0.12 standard deviations.
        quantiles = np.interp((0.1, 0.9), np.cumsum(share) - share / 2, grid)
        assert np.quantile(draws, (0.1, 0.9)) == pytest.approx(quantiles, abs=0.35 * deviation)
        assert found.ci95(name) == tuple(np.quantile(draws, (0.025, 0.975)))
    assert found.samples["Fv"].min() >= lower and "Fv" in repr(found)
