"""A mass in closed form whose speed six sensors measure, one of which reads too much."""

import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.refits.refit import refit
from jaxid.explanation.search.one_of_several import with_one_alone
from jaxid.explanation.search.telling_apart import told_apart_from
from jaxid.logs import noise_scale
from jaxid.simulation.scaled import scaled_to

NAMES, SCALE, NOISE = ("a", "b", "c", "d", "e", "f"), 1.05, 0.004
CHANNELS = Channels(("u",), NAMES, units={"u": "N"} | dict.fromkeys(NAMES, "m/s"))


def logs(seed, count):
    """Logs of 10 s under held forces on 1 kg with 2 N s/m; the third sensor reads 5 % too much."""
    found = []
    for k in range(count):
        random = np.random.default_rng([seed, k])
        u, v, speeds = np.repeat(random.uniform(-4, 4, 50), 10), 0.0, []
        for force in u:
            speeds.append(v)
            v = 0.5 * force + (v - 0.5 * force) * np.exp(-0.04)
        read = {name: np.array(speeds) * (SCALE if name == "c" else 1.0) for name in NAMES}
        read = {name: y + NOISE * random.normal(size=len(u)) for name, y in read.items()}
        found.append(Log.from_arrays(f"{seed} {k}", 0.02 * np.arange(len(u)), u[:, None], read, CHANNELS))
    return LogSet(found)


@pytest.fixture(scope="module")
def trials():
    """The law of every channel's own scale, and the same with that of one alone, as another name might do it."""
    fitted, held_out = logs(1, 2), logs(2, 1)
    noise = noise_scale(held_out, otherwise=fitted)
    robot = Custom(
        dynamics=lambda s, u, p: {"v": (u["u"] - p["viscous"] * s["v"]) / p["mass"]},
        state_names=("v",),
        output=lambda s, u, p: dict.fromkeys(NAMES, s["v"]),
        own_channels=CHANNELS,
        table={"mass": Parameter(1.1, "kg", free=True, lower=0.1), "viscous": Parameter(2.0, "N s/m")},
        title="cart",
    )
    robot = scaled_to(robot, fitted)
    start = output_error(robot, fitted)

    def refitted(model):
        values = {name: model.parameters[name].value for name in model.parameters.free_names}
        return refit(model, [values], fitted, held_out, noise, start.initial_states)

    each = start.robot + effect_by_id(start.robot, "sensor_scale", "each_channel")
    one = each
    for name in ("a", "b", "d", "e", "f"):
        one = one.change(f"sensor_scale.error_{name}", free=False)
    return refitted(each), refitted(one), (fitted, held_out, noise)


def test_one_number_alone_is_no_dearer_than_a_rival_of_one(trials):
    each, one, rest = trials
    assert each.score - one.score > 16.0  # the price of five numbers that do nothing
    alone = with_one_alone(each, one, *rest)
    table = alone.robot.parameters
    assert [name for name in table.free_names if "." in name] == ["sensor_scale.error_c"]
    assert table["sensor_scale.error_c"].value == pytest.approx(SCALE - 1.0, abs=0.002)
    assert alone.id == each.id and not told_apart_from(one, alone)


def test_a_law_that_is_not_told_apart_stays_whole(trials):
    each, one, rest = trials
    assert with_one_alone(each, each, *rest) is each
    assert with_one_alone(one, each, *rest) is one
