"""jaxid/effects/scattered.py: draws of delays, whose mean is the law that is fitted."""

import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Parameter
from jaxid.effects import effect_by_id
from jaxid.effects.scattered import changes_late, rows_late, samples_late, within
from tests.effects.at_once import commanded, measured

EDGES = 0.02 * np.arange(401)
STEPS = np.repeat(np.random.default_rng(3).normal(size=(20, 2)), 20, axis=0)
LONGEST = 0.07
BETWEEN = (0.0, LONGEST)


def test_every_change_comes_once_and_within_the_longest_delay():
    drawn = changes_late(STEPS, EDGES, BETWEEN, np.random.default_rng(1))
    assert drawn.shape == STEPS.shape
    for k in range(20, 400, 20):
        late = (drawn[k : k + 20] - STEPS[k]) / (STEPS[k - 1] - STEPS[k])  # the share of the old command that is left
        delay = 0.02 * late.sum(axis=0)
        assert delay[0] == pytest.approx(delay[1]) and 0.0 <= delay[0] <= LONGEST
        assert np.all(late[4:] < 1e-9)


def test_the_mean_of_delays_within_a_scatter_of_one_is_the_law():
    """0.07 s and no more than 0.03 s from it."""
    between, robot, time = (0.04, 0.10), Axis(), EDGES[:-1]
    random = np.random.default_rng(5)
    for mechanism, draw in (("input_delay", rows_late), ("sensor_delay", samples_late)):
        effect = effect_by_id(robot, mechanism, "scattered")
        numbers = {effect.key("delay"): 0.07, effect.key("scatter"): 0.03}
        signal = STEPS[:, :1] if mechanism == "input_delay" else np.sin(2.0 * time)[:, None]
        mean = np.mean(
            [draw(signal, EDGES if draw is rows_late else time, between, random) for _ in range(300)], axis=0
        )
        if mechanism == "input_delay":
            law = commanded(effect, signal, time, np.diff(EDGES), numbers, robot)
        else:
            law = measured(effect, signal, time, numbers, robot)
        assert np.abs(mean - law)[12:].max() < 0.04 * np.ptp(signal)


@pytest.mark.parametrize("scatter", [0.0, 0.02, 0.5])
def test_nothing_scatters_to_before_it_was_sent(scatter):
    shortest, longest = within(0.03, scatter)
    assert 0.0 <= shortest <= 0.03 <= longest <= 0.06 and shortest + longest == pytest.approx(0.06)


@pytest.mark.parametrize("draw", [changes_late, rows_late])
def test_the_mean_of_draws_of_commands_is_the_law(draw):
    random = np.random.default_rng(2)
    mean = np.mean([draw(STEPS, EDGES, BETWEEN, random) for _ in range(1500)], axis=0)
    robot = Axis()
    effect = effect_by_id(robot, "input_delay", "jittering")
    numbers = {effect.key("delay"): LONGEST / 2}
    law = np.stack(
        [commanded(effect, STEPS[:, [i]], EDGES[:-1], np.diff(EDGES), numbers, robot)[:, 0] for i in range(2)],
        axis=1,
    )
    # The first command has no past in the law; that of a log begins with it. Its mean is over eight delays.
    assert np.abs(mean - law)[8:].max() < 0.08 * np.ptp(STEPS)


def test_every_sample_is_of_its_own_past():
    time = EDGES[:-1]
    drawn = samples_late(np.stack([time, 2.0 - time], axis=1), time, BETWEEN, np.random.default_rng(4))
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
