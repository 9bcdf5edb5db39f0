"""jaxid/explanation/search/from_the_best.py: a twin of the best name that lost its way is found from where that one ends."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Channels, Custom, DriveAxis, Log, LogSet, Parameter
from jaxid.effects import effect_by_id
from jaxid.explanation.refits.refit import refit
from jaxid.explanation.screening.screen import screen
from jaxid.explanation.search.from_the_best import from_the_best

NOISE, PULL = {"v": 0.01}, -0.4
ROBOT = Custom(
    dynamics=lambda state, u, p, friction: {"v": (u["u"] - p["fv"] * state["v"] - friction["wheel"]) / p["mass"]},
    state_names=("v",),
    own_channels=Channels(inputs=("u",), outputs=("v",), units={"u": "N", "v": "m/s"}),
    table={
        "mass": Parameter(2.0, "kg", free=True, lower=0.1),
        "fv": Parameter(4.0, "N s/m", free=True, lower=0.0),
        "fc": Parameter(1.2, "N", free=True, lower=0.0),
    },
    axes={"wheel": DriveAxis(speed="v", coulomb="fc", viscous="fv", torque=lambda s, u, p: u["u"])},
    forces={"v": "mass"},
    velocities=("v",),
)


def pulled(seed):
    """A cart on a rail that is not level, whose dry friction holds it until the force exceeds it: steps of 0.2 ms."""
    rng, step = np.random.default_rng(seed), 2e-4
    u, v, seen = np.repeat(rng.uniform(-5.0, 5.0, 20), 20), 0.0, []
    for force in u:
        seen.append(v)
        for _ in range(100):
            drive = force + PULL - 4.0 * v
            free = v + step * drive / 2.0
            v = np.sign(free) * max(abs(free) - step * 1.2 / 2.0, 0.0)
    read = np.array(seen) + 0.01 * rng.normal(size=400)
    return Log.from_arrays(f"run {seed}", 0.02 * np.arange(400), u[:, None], read[:, None], ROBOT)


@pytest.mark.filterwarnings("ignore")
def test_a_pull_beside_friction_that_differs_by_direction():
    logs, held_out = LogSet([pulled(1), pulled(2)]), LogSet([pulled(3)])
    friction = effect_by_id(ROBOT, "asymmetric_friction", "all_axes")
    pull = effect_by_id(ROBOT, "ground_slope", "along_a_line")
    screened = screen(ROBOT, logs, [friction, pull], NOISE, {})
    assert {c.effect.id for c in screened if c.share > 0.7} == {"asymmetric_friction", "ground_slope"}
    start = dict(next(c for c in screened if c.effect.id == friction.id).starts[0])
    best = refit(ROBOT + friction, [start], logs, held_out, NOISE, {})
    assert best.fitted.adequate
    plain = refit(ROBOT, [{}], logs, held_out, NOISE, {})
    lost = replace(plain, id=pull.id, robot=plain.robot + pull)
    assert not lost.fitted.adequate
    found = from_the_best([[best], [lost]], screened, logs, held_out, NOISE, lambda text: None)
    twin = next(own[0] for own in found if own[0].id == pull.id)
    assert twin.robot.parameters[pull.key("force")].value == pytest.approx(PULL, abs=0.05)
    assert abs(twin.score - best.score) < 4.0 and twin.free == best.free
    # Beside a best one that leaves something nothing is asked.
    unlike = replace(best, fitted=plain.fitted)
    assert from_the_best([[unlike], [lost]], screened, logs, held_out, NOISE, pytest.fail) == [[unlike], [lost]]
