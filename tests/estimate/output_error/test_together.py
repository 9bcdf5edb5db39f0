"""Problems of one model side by side against each of them alone."""

import jax
import numpy as np
import pytest

from jaxid import Axis, Integrator, LogSet, Pioneer
from jaxid.effects.actuator import InputDelay
from jaxid.estimate.output_error import together
from jaxid.estimate.output_error.direct import linearised_directly
from jaxid.estimate.output_error.direct_costs import costs_directly, side_by_side
from jaxid.estimate.output_error.laid_out import direct
from jaxid.estimate.output_error.setup import build
from jaxid.estimate.output_error.together import costs_together, kind_of, linearised_together, member_of


def problems(robots, sets, initial):
    """(laid out in lanes, unknowns away from the start) of every robot and its logs."""
    rng = np.random.default_rng(4)
    found = []
    for robot, logs in zip(robots, sets, strict=True):
        structure, problem, unknowns = build(robot, logs, start={}, initial=initial, integrator=Integrator(2))
        moved = jax.tree.map(lambda leaf: np.asarray(leaf) + 0.1 * rng.normal(size=leaf.shape), unknowns)
        found.append((direct(structure, problem), moved))
    return found


def members(asked):
    return [(member_of(d), there) for d, there in asked]


def agree(found, expected):
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        size = np.abs(np.asarray(theirs)).max(initial=0.0)
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-11 * max(size, 1e-300))


@pytest.fixture(params=["axis", "pioneer"])
def asked(request, axis_log, demo_logs, double_precision):
    """Three problems with other constants, numbers of logs and lengths."""
    if request.param == "axis":
        rng = np.random.default_rng(1)
        logs = [axis_log(f"{k}", rng.uniform(-3, 3, T), noise=0.01, seed=k) for k, T in enumerate((100, 120, 90))]
        robots = [Axis().with_values(gain=gain) for gain in (1.0, 0.7, 1.3)]
        return problems(robots, [LogSet(logs[:1]), LogSet(logs[1:]), LogSet(logs[2:])], "known")
    logs = demo_logs("pioneer", "fit_m*")
    sets = [LogSet([log.window(0.0, seconds) for log in logs]) for seconds in (1.5, 1.3)]
    return problems([Pioneer(), Pioneer().with_values(m=30.0)], sets, "estimate")


@pytest.mark.parametrize("limit", ["", "_AT_A_TIME"])
def test_every_problem_gets_what_it_gets_alone(asked, monkeypatch, limit):
    if limit:  # large ones are taken one after another
        monkeypatch.setattr(together, limit, 0)
    assert len({kind_of(d) for d, _ in asked}) == 1 and kind_of(asked[0][0]) is not None
    for (d, there), found in zip(asked, linearised_together(members(asked)), strict=True):
        agree(found, linearised_directly(d, there))
    shares = (1.0,), (1.0, 0.9), (0.9, 1.0, 1.1)  # as many for each as it asks for
    many = [
        (d, jax.tree.map(lambda leaf, own=own: np.stack([share * leaf for share in own]), there))
        for (d, there), own in zip(asked, shares, strict=False)
    ]
    for (d, candidates), found in zip(many, costs_together(members(many)), strict=True):
        agree(found, costs_directly(d, side_by_side(d, len(candidates.z)), candidates))


def test_effects_on_records_are_by_themselves(axis_log, double_precision):
    robot = Axis() + InputDelay()
    log = axis_log("a", np.ones(50))
    ((d, _),) = problems([robot], [LogSet([log])], "known")
    assert kind_of(d) is None
