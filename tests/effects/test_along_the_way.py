"""Dry friction that depends on the place along a rail: an axis with true sticking, simulated in NumPy."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.effects import effect_by_id
from jaxid.effects.curve import SHAPE
from jaxid.simulation.scaled import scaled_to

M, B, DT, STEPS = 5.0, 8.0, 0.02, 20


def level(q):
    """Coulomb friction [N]: the far end of the rail is worn."""
    return 5.0 + 2.0 * np.tanh((q - 0.3) / 0.25)


def logs(seeds, seconds=20.0):
    """Semi-implicit Euler at 1 ms; what friction can hold for a step stands still."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        count = int(seconds / DT)
        force = np.repeat(rng.uniform(-16.0, 16.0, count // 20 + 1), 20)[:count]
        q = v = 0.0
        rows = []
        for f in force:
            # The command keeps it on its rail.
            f = f - 12.0 * (q - 0.3)
            rows.append((f, v, q))
            for _ in range(STEPS):
                h = DT / STEPS
                pushed = v + h * (f - B * v) / M
                held = h * level(q) / M
                v = 0.0 if abs(pushed) <= held else pushed - held * np.sign(pushed)
                q += h * v
        acting, speed, way = np.array(rows).T
        outputs = {"v": speed + rng.normal(0, 0.005, count), "q": way + rng.normal(0, 0.0005, count)}
        found.append(Log.from_arrays(f"run {seed}", DT * np.arange(count), acting[:, None], outputs, AXIS))
    return LogSet(found)


def test_the_curve_lies_over_the_way_of_the_logs():
    every = logs([1], 5.0)
    robot = scaled_to(Axis(), every)
    low, high = robot.scales.way
    assert low == pytest.approx(every[0].output("q").min()) and high == pytest.approx(every[0].output("q").max())
    law = effect_by_id(robot, "surface_change", SHAPE)
    numbers = (robot + law).parameters.numbers | {law.key("at_6"): 2.0}
    for place, more in ((low, 0.0), (0.5 * (low + high), 0.0), (high, 2.0), (high + 1.0, 2.0)):
        ((back, ahead),) = law.dry(((5.0, 5.0),), (0.1,), {"q": place, "v": 0.1}, numbers, robot + law)
        assert float(back) == float(ahead) == pytest.approx(5.0 + more, abs=1e-4)


@pytest.mark.slow
def test_a_worn_stretch_of_a_rail_is_named_with_its_place():
    fit = output_error(Axis(), logs([1, 2, 3]))
    found = explain(fit, logs([1, 2, 3]), logs([8, 9]))
    assert "surface_change" in [effect.id for effect in found.effects]
    assert found.verdict in ("named", "ambiguous") and found.after.normalised_rms < 1.2
    own = found.final.parameters
    for name, truth in (("M", M), ("Fv", B)):
        assert abs(own[name].value - truth) < 4.0 * own[name].std_error + 0.01 * truth
    # The curve is the friction's, but for its level in the middle.
    law, robot = found.final.robot.effects[0], found.final.robot
    low, high = robot.scales.way
    places = np.linspace(low + 0.15 * (high - low), high - 0.15 * (high - low), 9)
    numbers = {name: e.value for name, e in own.items()}
    seen = [float(law.dry(((numbers["Fc"],) * 2,), (0.1,), {"q": q, "v": 0.1}, numbers, robot)[0][0]) for q in places]
    np.testing.assert_allclose(seen, level(places), atol=0.5)
