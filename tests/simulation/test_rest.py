"""A motor whose current is measured: V = R i + K w, J dw/dt = K i - B w, in closed form."""

import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, identifiability, output_error, profile_likelihood
from jaxid.simulation.start import initial_states

CHANNELS = Channels(inputs=("V",), outputs=("n", "i"), units={"V": "V", "n": "rad/s", "i": "A"})
TRUE = {"R": 0.8, "K": 0.05, "J": 1e-3, "B": 1e-3}
INTERVAL, NOISE = 0.02, (0.5, 0.05)


def current(s, u, p):
    return (u["V"] - p["K"] * s["w"]) / p["R"]


def motor(free=True, **values):
    start = TRUE | values
    units = {"R": "ohm", "K": "N m/A", "J": "kg m^2", "B": "N m s"}
    return Custom(
        dynamics=lambda s, u, p: {"w": (p["K"] * current(s, u, p) - p["B"] * s["w"]) / p["J"]},
        output=lambda s, u, p: {"n": s["w"], "i": current(s, u, p)},
        state_names=("w",), own_channels=CHANNELS, title="motor",
        table={name: Parameter(start[name], unit, free=free, lower=0.0) for name, unit in units.items()},
    )  # fmt: skip


def log(name, seed, first=8.0, w=0.0, speed_measured=True):
    """Speed and current of the motor above, whose speed goes exponentially to the one that belongs to the voltage."""
    rng = np.random.default_rng(seed)
    volts = np.repeat(np.concatenate([[first], rng.uniform(-10, 10, 19)]), 10)
    loss = TRUE["K"] ** 2 / TRUE["R"] + TRUE["B"]
    stays = np.exp(-INTERVAL * loss / TRUE["J"])
    speeds = []
    for v in volts:
        speeds.append(w)
        w = stays * w + (1 - stays) * TRUE["K"] * v / TRUE["R"] / loss
    speeds = np.array(speeds)
    outputs = np.stack([speeds, (volts - TRUE["K"] * speeds) / TRUE["R"]], axis=1) + NOISE * rng.normal(size=(200, 2))
    outputs[0, 0] = outputs[0, 0] if speed_measured else np.nan
    return Log.from_arrays(name, INTERVAL * np.arange(200), volts[:, None], outputs, CHANNELS)


RESTING = LogSet([log("a", 1), log("b", 2, first=-9.0), log("c", 3, first=6.0)])


@pytest.mark.parametrize("wrong", [0.01, 0.3, 3.0, 30.0])
def test_a_current_that_a_wrong_resistance_does_not_explain_is_no_motion(wrong):
    start = initial_states(motor(R=wrong * TRUE["R"]), RESTING)
    assert not start.uncertain.any() and start.states["w"].tolist() == [0.0, 0.0, 0.0]


def test_a_log_that_starts_in_motion_is_told_among_logs_at_rest_whatever_the_resistance_began_with():
    """Its first speed is not measured: (V - R i) / K is what the current says of it."""
    logs = LogSet([*RESTING, log("moving", 4, first=5.0, w=100.0, speed_measured=False)])
    start = initial_states(motor(R=5 * TRUE["R"]), logs)
    assert start.uncertain.tolist() == [False, False, False, True]
    assert start.states["w"][3] == pytest.approx(100.0, abs=5 * TRUE["R"] * NOISE[1] / TRUE["K"])


def test_what_is_known_is_not_changed_to_explain_a_first_sample():
    start = initial_states(motor(free=False, R=2 * TRUE["R"]), RESTING)
    assert start.uncertain.all()


@pytest.mark.parametrize("initial", ["auto", "known"])
def test_a_fit_from_a_bad_start_knows_that_the_motor_stood_still(initial):
    fit = output_error(motor(R=2.4, K=0.02, J=4e-3, B=3e-4), RESTING, initial_states=initial)
    assert fit.judgement is not None and fit.judgement.verdict == "sound"
    for name, true in TRUE.items():
        assert abs(fit[name].value - true) < 4 * fit[name].std_error
    assert all(states == {"w": 0.0} for states in fit.initial_states.values())
    # What is said of the fit is said of the same initial states.
    expected = identifiability(fit.robot, RESTING).std_errors["R"]
    assert fit["R"].std_error == pytest.approx(expected, rel=0.2)
    low, high = profile_likelihood(fit, RESTING, ["R"])["R"].ci95
    assert high - low == pytest.approx(2 * 1.96 * fit["R"].std_error, rel=0.1)
