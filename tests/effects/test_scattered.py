"""jaxid/effects/scattered.py: draws of delays, whose mean is the law that is fitted."""

import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Parameter
from jaxid.effects import effect_by_id
from jaxid.effects.scattered import changes_late, rows_late, samples_late

EDGES = 0.02 * np.arange(401)
STEPS = np.repeat(np.random.default_rng(3).normal(size=(20, 2)), 20, axis=0)
LONGEST = 0.07


def test_every_change_comes_once_and_within_the_longest_delay():
    drawn = changes_late(STEPS, EDGES, LONGEST, np.random.default_rng(1))
    assert drawn.shape == STEPS.shape
    for k in range(20, 400, 20):
        late = (drawn[k : k + 20] - STEPS[k]) / (STEPS[k - 1] - STEPS[k])  # the share of the old command that is left
        delay = 0.02 * late.sum(axis=0)
        assert delay[0] == pytest.approx(delay[1]) and 0.0 <= delay[0] <= LONGEST
        assert np.all(late[4:] < 1e-9)


@pytest.mark.parametrize("draw", [changes_late, rows_late])
def test_the_mean_of_draws_of_commands_is_the_law(draw):
    random = np.random.default_rng(2)
    mean = np.mean([draw(STEPS, EDGES, LONGEST, random) for _ in range(1500)], axis=0)
    robot = Axis()
    effect = effect_by_id(robot, "input_delay", "jittering")
    numbers = {effect.key("delay"): LONGEST / 2}
    law = np.stack(
        [np.asarray(effect.command(STEPS[:, [i]], EDGES[:-1], np.diff(EDGES), numbers, robot))[:, 0] for i in range(2)],
        axis=1,
    )
    # The first command has no past in the law; that of a log begins with it. Its mean is over eight delays.
    assert np.abs(mean - law)[8:].max() < 0.08 * np.ptp(STEPS)


def test_every_sample_is_of_its_own_past():
    time = EDGES[:-1]
    drawn = samples_late(np.stack([time, 2.0 - time], axis=1), time, LONGEST, np.random.default_rng(4))
    ages = time - drawn[:, 0]
    assert np.allclose(drawn.sum(axis=1), 2.0)
    assert ages[10:].min() >= 0.0 and ages.max() <= LONGEST and np.std(ages[10:]) > 0.2 * LONGEST


def test_only_what_drives_is_drawn():
    channels = Channels(("throttle", "steering"), ("v", "r"), units={"throttle": "V", "steering": "rad"})
    table = {"k": Parameter(1.0, "", free=True), "j": Parameter(1.0, "", free=True)}

    def dynamics(state, u, p):
        return {"v": p["k"] * u["throttle"] - state["v"], "r": p["j"] * u["steering"] - state["r"]}

    car = Custom(dynamics=dynamics, state_names=("v", "r"), own_channels=channels, table=table, title="car")
    effect = effect_by_id(car, "input_delay", "jittering")
    numbers = {effect.key("delay"): LONGEST / 2}
    draws = effect.draws(numbers, car)
    assert [draw.of for draw in draws] == ["inputs", "inputs"]
    for draw in draws:
        drawn = draw.once(STEPS, EDGES[:-1], np.random.default_rng(0))
        assert np.array_equal(drawn[:, 1], STEPS[:, 1]) and not np.allclose(drawn[:, 0], STEPS[:, 0])
