"""jaxid/estimate/output_error/other_units.py: columns in degrees, turns and mm, of a body in closed form."""

import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, output_error

BODY = Custom(
    dynamics=lambda s, u, p: {
        "v": (u["right"] + u["left"] - 12.0 * s["v"]) / p["M"],
        "w": (0.2 * (u["right"] - u["left"]) - 0.4 * s["w"]) / p["J"],
    },
    state_names=("v", "w"),
    own_channels=Channels(
        inputs=("right", "left"),
        outputs=("v", "w"),
        units={"right": "N", "left": "N", "v": "m/s", "w": "rad/s"},
    ),
    table={"M": Parameter(8.0, "kg", free=True, lower=0.0), "J": Parameter(0.3, "kg m^2", free=True, lower=0.0)},
)


def logs(scale=(1.0, 1.0), drifts=False):
    """Three logs of 10 kg and 0.1 kg m^2 that hardly turns, their columns times so much; or with a gyro of another body."""
    random, found = np.random.default_rng(3), []
    for k in range(3):
        forces = np.repeat(random.uniform(-4, 4, (20, 1)) + random.uniform(-0.3, 0.3, (20, 2)), 25, axis=0)
        motion = np.zeros((501, 2))
        for i, (right, left) in enumerate(forces):
            for j, (final, rate) in enumerate((((right + left) / 12, 1.2), ((right - left) / 2, 4.0))):
                motion[i + 1, j] = final + (motion[i, j] - final) * np.exp(-0.02 * rate)
        if drifts:
            motion[1:, 1] = 5.0 * np.repeat(random.uniform(-1, 1, 20), 25)
        seen = (motion[:500] + 0.01 * random.normal(size=(500, 2))) * scale
        found.append(Log.from_arrays(f"{k}", 0.02 * np.arange(500), forces, seen, BODY))
    return LogSet(found)


@pytest.mark.parametrize(
    ("scale", "said"),
    [
        ((1.0, np.degrees(1.0)), "Taken for degrees a second, w fits"),
        ((1.0, 30.0 / np.pi), "Taken for revolutions a minute, w fits"),
        ((1000.0, 1.0), "Taken for mm/s, v fits"),
    ],
)
def test_a_column_in_another_unit_is_named_where_the_model_follows_with_it(scale, said):
    fit = output_error(BODY, logs(scale))
    (note,) = [note for note in fit.notes if "Taken for" in note]
    assert note.startswith(said) and fit.failed
    factor = float(note.removesuffix(".").rsplit(" ", 1)[1])
    assert factor == pytest.approx(1.0 / max(scale), rel=1e-5)


def test_a_column_that_no_unit_makes_right_is_none():
    fit = output_error(BODY, logs(drifts=True))
    assert fit.failed and not any("Taken for" in note for note in fit.notes)
    assert not any("Taken for" in note for note in output_error(BODY, logs()).notes)
