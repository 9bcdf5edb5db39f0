"""Priors that contradict the logs are said to, those that agree are not."""

import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, output_error
from jaxid.estimate.prior_conflict import prior_conflicts
from jaxid.estimate.result import Estimate
from jaxid.parameters import Parameter, ParameterTable
from jaxid.robots import Axis
from jaxid.simulation.simulate import simulate

TRUTH = {"M": 3.0, "Fv": 4.0}


@pytest.fixture(scope="module")
def logs():
    """Two logs of a moving axis, with noise."""
    rng, robot = np.random.default_rng(7), Axis().with_values(**TRUTH)
    forces = np.repeat(rng.uniform(-30, 30, (2, 20, 1)), 15, axis=1)
    still = np.zeros((300, 1))
    made = LogSet([Log.from_arrays(f"log {k}", 0.02 * np.arange(300), u, still, robot) for k, u in enumerate(forces)])
    speeds = [y[:, :1] + 0.01 * rng.standard_normal((300, 1)) for y in simulate(robot, made)]
    return LogSet(
        [Log.from_arrays(log.name, log.time, log.inputs, y, robot) for log, y in zip(made, speeds, strict=True)]
    )


def fit(logs, **prior):
    robot = Axis()
    for name, value in prior.items():
        robot = robot.change(name, prior=value)
    return output_error(robot, logs)


def test_a_prior_that_the_logs_contradict_is_said_to_be_wrong(logs):
    alone = fit(logs)
    error = alone["M"].std_error
    assert abs(alone["M"].value - 3.0) < 4 * error
    wrong = fit(logs, M=(3.0 + 12 * error, error))
    assert wrong.judgement.verdict == "poor"
    assert wrong.judgement.sentences[0].startswith("The prior of M")
    # It says what the fit without the prior says.
    said = float(wrong.judgement.sentences[0].split("alone say about ")[1].split(" ±")[0])
    assert said == pytest.approx(alone["M"].value, abs=2 * error)


@pytest.mark.parametrize("spread", [0.3, 1.0, 30.0])
def test_a_prior_that_agrees_is_not_spoken_of(logs, spread):
    error = fit(logs)["M"].std_error
    right = fit(logs, M=(3.0 + spread * error, spread * error))
    assert right.judgement.verdict == "sound" and not any("prior" in note for note in right.notes)


def test_false_alarms_are_as_rare_as_said():
    """Both drawn about one truth, 20,000 times."""
    rng = np.random.default_rng(3)
    for ratio in (0.3, 1.0, 5.0):  # of the prior's spread to the data's
        prior, data = ratio * rng.standard_normal(20_000), rng.standard_normal(20_000)
        variance = 1.0 / (1.0 + ratio**-2)
        both = variance * (data + prior / ratio**2)
        said = 0
        for mean, value in zip(prior, both, strict=True):
            table = ParameterTable({"M": Parameter(1.0, "kg", free=True, prior=(float(mean), ratio))})
            error = float(variance**0.5)
            said += bool(prior_conflicts(table, {"M": Estimate.of(float(value), error, "kg")}, {"M": error}))
        assert said < 25  # 9 expected


@pytest.mark.parametrize("known", [True, False])
def test_coloured_noise_makes_no_conflict(known):
    """The data scatters three times as far as white noise would have it, and the standard error knows."""
    rng, said, conflicts = np.random.default_rng(4), 0, 0
    for ratio in (0.3, 1.0, 5.0):
        prior, data = ratio * rng.standard_normal(10_000), 3.0 * rng.standard_normal(10_000)
        variance = 1.0 / (1.0 + ratio**-2)
        error = float(np.sqrt((variance * 3.0) ** 2 + (variance / ratio**2 * ratio) ** 2))
        for mean, value in zip(prior, variance * (data + prior / ratio**2), strict=True):
            table = ParameterTable({"M": Parameter(1.0, "kg", free=True, prior=(float(mean), ratio))})
            white = {"M": float(variance**0.5)} if known else None
            said += bool(prior_conflicts(table, {"M": Estimate.of(float(value), error, "kg")}, white))
            far = Estimate.of(float(value) + 40.0, error, "kg")
            conflicts += bool(prior_conflicts(table, {"M": far}, white))
    assert said < 40 and conflicts > 29_000  # 14 expected


def test_a_true_prior_that_alone_says_how_far_another_is_from_its_bound_is_no_contradiction():
    """Gain and back-EMF by one constant, of which the logs know no more than its share in two sums: K / R, and Fv + K² / R."""

    def model(K, **prior):
        return Custom(
            dynamics=lambda s, u, p: {"v": (p["K"] * (u["u"] - p["K"] * s["v"]) / p["R"] - p["Fv"] * s["v"]) / p["M"]},
            state_names=("v",),
            own_channels=Channels(inputs=("u",), outputs=("v",)),
            table={
                "K": Parameter(K, free=True, lower=1e-4, **prior),
                "R": Parameter(1.2, free=True, lower=0.01),
                "Fv": Parameter(0.5, free=True, lower=0.0),
                "M": Parameter(1.0),
            },
        )

    rng, robot = np.random.default_rng(9), model(2.0)
    inputs = np.repeat(rng.uniform(-6.0, 6.0, (20, 1)), 20, axis=0)
    time = 0.02 * np.arange(400)
    (v,) = simulate(robot, LogSet([Log.from_arrays("a", time, inputs, np.zeros((400, 1)), robot)]))
    logs = LogSet([Log.from_arrays("a", time, inputs, v[:, :1] + 0.01 * rng.standard_normal((400, 1)), robot)])
    fit = output_error(model(2.0, prior=(2.0, 0.2)), logs)
    assert fit.judgement.verdict == "sound"
    assert fit["K"].value == pytest.approx(2.0, abs=0.01) and fit["K"].std_error == pytest.approx(0.2, rel=0.05)
    assert abs(fit["Fv"].value - 0.5) < fit["Fv"].std_error
