"""What a missing force is a function of: forces made by formula along motions made by formula, beside shares of the speed, of
the sign of travel and of the input such as wrong parameters leave."""

import numpy as np
import pytest

from jaxid.explanation.where.conditions import Motion
from jaxid.explanation.where.missing_force import ForceHistory
from jaxid.explanation.where.patterns import answering, patterns, telling

DT, SAMPLES, LOGS = 0.02, 1201, 5
TIME = DT * np.arange(SAMPLES)


def waves(rng, size, fastest):
    """A sum of three sines of random frequencies up to `fastest` [Hz]."""
    each = [np.sin(2 * np.pi * rng.uniform(0.05, fastest) * TIME + rng.uniform(0, 7)) for _ in range(3)]
    return size * np.sum(each, axis=0) / np.sqrt(1.5)


def drives():
    """Motions of a robot in the plane with forward speed and yaw rate, by dead reckoning of random sines."""
    found = []
    for seed in range(LOGS):
        rng = np.random.default_rng([47, seed])
        v, w = waves(rng, 0.5, 0.4), waves(rng, 0.7, 0.3)
        heading = np.cumsum(w) * DT + rng.uniform(-1, 1)
        path = np.cumsum(np.stack([v * np.cos(heading), v * np.sin(heading)], axis=1), axis=0) * DT
        found.append((v, w, heading, path + rng.uniform(-0.3, 0.3, 2), waves(rng, 3.0, 0.5)))
    middle = np.median(np.concatenate([path for *_, path, _ in found]), axis=0)
    return [
        Motion(
            time=TIME, near=0.5, inputs=u[:, None], largest=np.array([6.0]), axes=np.stack([v, w], axis=1),
            axis_names=("v", "w"), still=np.array([0.01, 0.01]), fastest=np.array([1.0, 1.4]), ahead=v, ahead_fastest=1.0,
            turning=w, turning_fastest=1.4, heading=heading, path=path, middle=middle,
        )
        for v, w, heading, path, u in found
    ]  # fmt: skip


MOTIONS = drives()


def followed(force):
    """The patterns of `force(motion, log)` [T] on the speed, with shares of wrong parameters and noise besides."""
    histories = []
    for e, motion in enumerate(MOTIONS):
        rng = np.random.default_rng([53, e])
        wrong = -0.25 * motion.ahead + 0.1 * np.sign(motion.ahead) + 0.03 * motion.inputs[:, 0]
        one = force(motion, e) + wrong + 0.1 * rng.normal(size=SAMPLES)
        both = np.stack([one, 0.1 * rng.normal(size=SAMPLES)], axis=1)
        names, units = ("v", "w"), ("N", "N m")
        histories.append(ForceHistory(f"{e}", TIME, both, 0.1 + 0 * both, names, units, np.ones(2), np.ones(2)))
    return patterns(histories, MOTIONS)


def to_a_point(motion, e):
    off = np.array([0.5, -1.0]) - motion.path
    return 0.8 * (off[:, 0] * np.cos(motion.heading) + off[:, 1] * np.sin(motion.heading))


@pytest.mark.parametrize(
    ("force", "name"),
    [
        (lambda motion, e: 2.0 * (np.exp(-motion.time / 12.0) - 0.43) * motion.ahead, "speed by time"),
        (lambda motion, e: 0.5 * np.sign(motion.ahead) * motion.path[:, 0], "direction of travel by place"),
        (to_a_point, "heading by place"),
        (lambda motion, e: [0.5, -0.6, 0.7, -0.4, 0.2][e] * np.sign(motion.ahead), "direction of travel by log"),
        (lambda motion, e: 0.5 * np.sin(2 * np.pi * 1.1 * motion.time + e), "period of its own"),
        (lambda motion, e: 0.5 * motion.path[:, 1] ** 2, "place"),
        (lambda motion, e: 0.6 * np.cos(motion.heading - 0.4), "heading"),
        (lambda motion, e: 1.5 * motion.ahead * np.abs(motion.ahead), "speed"),
    ],
)
def test_what_the_force_is_a_function_of_comes_first(force, name):
    found = followed(force)
    assert found[0].name == name
    assert answering(found) is found[0]
    assert found[0].p_value < 0.01
    made = np.concatenate([force(motion, e) for e, motion in enumerate(MOTIONS)])
    drawn = np.concatenate([fitted[:, 0] for fitted in found[0].fitted])
    wrong = np.concatenate([-0.25 * m.ahead + 0.1 * np.sign(m.ahead) + 0.03 * m.inputs[:, 0] for m in MOTIONS])
    assert np.std(made + wrong - drawn) < 0.5 * np.std(made + wrong)


def test_a_period_is_told():
    period = next(
        p for p in followed(lambda motion, e: 0.5 * np.sin(2 * np.pi * motion.time / 0.8)) if "period" in p.name
    )
    assert float(period.phrase.split("about ")[1].split(" s ")[0]) == pytest.approx(0.8, rel=0.1)


def test_chance_follows_nothing():
    def rough(motion, e):
        steps = np.random.default_rng([59, e]).normal(size=SAMPLES // 40 + 1)
        return np.repeat(steps, 40)[:SAMPLES]

    found = followed(rough)
    assert telling(found) is None and answering(found) is None
