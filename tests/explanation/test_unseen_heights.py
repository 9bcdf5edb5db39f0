"""Heights of a curve at which the fitted logs have nothing stay where they were."""

import numpy as np

from jaxid import Axis, Log, LogSet
from jaxid.effects import effect_by_id
from jaxid.effects.drivetrain.by_axis import WAYS
from jaxid.explanation.refit import refit
from jaxid.logs import noise_scale

MASS, VISCOUS, COULOMB, DT = 1.0, 2.0, 0.8, 0.02


def _forwards(name: str, seed: int) -> Log:
    """Speeds of an axis that is only driven forwards, in closed form: viscous and Coulomb friction of one direction."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(1.5, 6.0, 40), 10)
    decay, v, found = np.exp(-VISCOUS / MASS * DT), 0.2, []
    for force in u:
        found.append(v)
        settled = (force - COULOMB) / VISCOUS
        v = settled + (v - settled) * decay
    outputs = {"v": np.array(found) + 0.003 * rng.normal(size=len(u))}
    return Log.from_arrays(name, DT * np.arange(len(u)), u[:, None], outputs, "axis")


def test_a_way_that_was_never_gone_has_no_curve():
    logs, held_out = LogSet([_forwards("one", 1), _forwards("two", 2)]), LogSet([_forwards("three", 3)])
    axis = Axis().change("offset", free=False).with_values(M=MASS, Fv=VISCOUS, Fc=COULOMB, offset=0.0)
    law = effect_by_id(axis, "asymmetric_viscous_friction", "shape")
    robot = axis + law
    start = {n: 0.01 if law.is_height(n) else robot.parameters[n].value for n in robot.parameters.free_names}
    trial = refit(robot, [start], logs, held_out, noise_scale(held_out), {})
    forward, backward = ([n for n in robot.parameters if law.is_height(n) and n.endswith(way)] for way in WAYS)
    assert len(forward) == len(backward) > 1
    table = trial.robot.parameters
    assert all(table[name].value == 0.0 and not table[name].free for name in backward)
    assert all(table[name].free for name in forward if not name.startswith(law.key("at_1")))
    assert trial.free == len(table.free_names)
    assert 0.8 < trial.held_out.normalised_rms < 1.2
    assert not trial.effect.agrees(trial.robot)  # nothing says that backwards is otherwise
