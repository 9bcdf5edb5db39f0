"""Commands of another unit than they are declared in: no effect is looked for, and none named."""

import numpy as np

from jaxid import Channels, Custom, DriveAxis, Log, LogSet, Parameter, explain, output_error

K, R, B, M, DT = 5.0, 2.0, 1.0, 9.0, 0.02

ROBOT = Custom(
    dynamics=lambda s, u, p: {"v": (p["K"] * (u["u"] - p["K"] * s["v"]) / p["R"] - p["B"] * s["v"]) / p["M"]},
    state_names=("v",),
    own_channels=Channels(inputs=("u",), outputs=("v",), units={"u": "V", "v": "m/s"}),
    table={
        "M": Parameter(8.0, "kg", free=True, lower=0.1),
        "B": Parameter(1.5, "N s/m", free=True, lower=0.0),
        "K": Parameter(K, "N/A"),
        "R": Parameter(R, "ohm"),
    },
    axes={
        "wheel": DriveAxis(speed="v", torque=lambda s, u, p: p["K"] * (u["u"] - p["K"] * s["v"]) / p["R"], angle="phi")
    },
    forces={"v": "M"},
    winding="R",
)


def run(seed):
    """Half a minute under currents that a controller of currents holds, exact between samples, and measured with noise."""
    rng = np.random.default_rng(seed)
    amps, keep, v, seen = np.repeat(rng.uniform(-0.6, 0.6, 30), 50), np.exp(-DT * B / M), 0.0, []
    for i in amps:
        seen.append(v)
        v = keep * v + (1.0 - keep) * K * i / B
    shown = np.array(seen) + 0.004 * rng.normal(size=len(seen))
    return Log.from_arrays(f"run {seed}", DT * np.arange(len(amps)), amps[:, None], shown[:, None], ROBOT)


def test_currents_that_are_taken_for_volts_get_no_name():
    logs, held_out = LogSet([run(1), run(2)]), LogSet([run(3)])
    fit = output_error(ROBOT, logs)
    assert any("would brake the robot" in note for note in fit.notes)
    said = []
    found = explain(fit, logs, held_out, report=said.append)
    assert found.verdict == "unexplained" and not found.effects
    assert any("would brake the robot" in note for note in found.notes)
    assert any("contradict the model" in doubt for doubt in found.doubts)
    assert not any("first look at" in message for message in said)
