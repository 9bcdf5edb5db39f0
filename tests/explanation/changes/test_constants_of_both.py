"""A constant of the table that is wrong in both sets is no change: a cart whose mass lies ahead of its axle."""

import numpy as np
import pytest

from jaxid import DifferentialDrive, Log, LogSet, explain_change, output_error
from jaxid.explanation.changes.in_both import constants_of_both
from jaxid.explanation.changes.joint import Pair, refit, white
from jaxid.explanation.changes.sides import side_of

M, J, HALF, FV, GAIN, BACK_EMF, AHEAD = 12.0, 0.4, 0.2, 1.5, 2.0, 8.0, 0.06
DT, SAMPLES = 0.02, 400


def rates(nu, volts, mass, inertia, ahead):
    """Newton and Euler about the centre of mass, `ahead` of the axle [m], which cannot slide sideways."""
    v, w = nu
    rims = np.array([v + HALF * w, v - HALF * w])
    force = GAIN * (volts - BACK_EMF * rims) - FV * rims
    along, turning = force.sum(), HALF * (force[0] - force[1])
    return np.array([along / mass + ahead * w * w, (turning - mass * ahead * v * w) / (inertia + mass * ahead**2)])


def recorded(seed, mass, inertia, ahead):
    logs = []
    for k in range(3):
        rng, nu, seen = np.random.default_rng([seed, k]), np.zeros(2), []
        u = np.repeat(rng.uniform(-12.0, 12.0, (SAMPLES // 25, 2)), 25, axis=0)
        for volts in u:
            seen.append(nu)
            for _ in range(4):  # Heun's steps
                one = rates(nu, volts, mass, inertia, ahead)
                nu = nu + 0.125 * DT * (one + rates(nu + 0.25 * DT * one, volts, mass, inertia, ahead))
        outputs = np.array(seen) + rng.normal(size=(SAMPLES, 2)) * (0.006, 0.02)
        logs.append(Log.from_arrays(f"run {seed} {k}", DT * np.arange(SAMPLES), u, outputs, DifferentialDrive()))
    return LogSet(logs)


def fitted(after_lies_at):
    robot = DifferentialDrive().with_values(b=HALF, gain=GAIN, back_emf=BACK_EMF, M=M, J=J, Fv=FV, Fc=0.0)
    robot = robot.change("Fc", free=False)
    sets = recorded(1, M, J, AHEAD if after_lies_at == "both" else 0.0), recorded(2, 1.2 * M, 1.1 * J, AHEAD)
    return [output_error(robot, logs) for logs in sets], sets


@pytest.mark.parametrize("where", ["both", "after"])
def test_what_does_not_change_where_both_sets_have_it_is_the_tables_constant(where):
    (before, after), sets = fitted(where)
    sides = {"before": side_of(before, sets[0]), "after": side_of(after, sets[1])}
    pair = Pair.of(before.robot, before.free_names, sides)
    theta = np.array([before.robot.parameters[name].value for name in pair.free])
    load = next(own for own in pair.own if own.id == "payload_off_centre")
    best = refit(pair, load, white(pair), theta)
    found = constants_of_both(pair, [best], white(pair))
    if where == "after":
        assert found is None  # a load that lies ahead of the axle
        return
    assert found is not None
    names, both = found
    assert "xc" in names and not {"M", "J"} & set(names)
    k = len(pair.free) + names.index("xc")
    assert both.theta[k] == pytest.approx(AHEAD, abs=0.002)
    change = dict(zip((c.name for c in load.coordinates), both.delta, strict=True))
    assert change["M"] == pytest.approx(0.2 * M, rel=0.02) and abs(change["xc"]) < 0.003


@pytest.mark.slow
def test_the_change_is_named_beside_it_and_the_constant_said():
    fits, sets = fitted("both")
    found = explain_change(*fits, *sets)
    assert found.verdict == "named" and found.change.id == "payload"
    assert found.change.differences["M"].size.value == pytest.approx(0.2 * M, rel=0.02)
    assert "xc" in found.freed and found.freed["xc"] == 0.0 and found.to_dict()["freed"] == found.freed
    assert "the table's xc of 0 m (0.06 before, 0.06 after)" in found.sentence
    assert found.before.robot.parameters["xc"].value == pytest.approx(AHEAD, abs=0.003)
