"""Heights of a curve at which the fitted logs have nothing are held level with the nearest that they tell."""

from dataclasses import replace

import numpy as np

from jaxid import Axis, Log, LogSet
from jaxid.effects import effect_by_id
from jaxid.effects.drivetrain.by_axis import WAYS
from jaxid.explanation.refits.refit import in_full, refit
from jaxid.explanation.refits.unseen_heights import held_level, ran_away
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


def test_beyond_what_was_driven_a_curve_goes_on_level_wherever_a_search_had_left_it():
    logs, held_out = LogSet([_forwards("one", 1), _forwards("two", 2)]), LogSet([_forwards("three", 3)])
    axis = Axis().change("offset", free=False).with_values(M=MASS, Fv=VISCOUS, Fc=COULOMB, offset=0.0)
    law = effect_by_id(axis, "asymmetric_viscous_friction", "shape")
    robot = (axis + law).with_values(**{law.key("reach"): 4.0 * max(np.max(log.output("v")) for log in logs)})
    forward = [n for n in robot.parameters.free_names if law.is_height(n) and n.endswith("forward")]
    away = [n for n in robot.parameters.free_names if law.is_height(n) and n not in forward[:-1]]
    start = {n: 1e6 if n in away else robot.parameters[n].value for n in robot.parameters.free_names}
    noise = noise_scale(held_out)
    trial = refit(robot.with_values(**start), [start], logs, held_out, noise, {})
    table = trial.robot.parameters
    assert 0.8 < trial.held_out.normalised_rms < 1.2
    assert not any(table[n].free for n in away) and all(abs(table[n].value) < 10.0 for n in away)
    # The same of a fit whose search left them far off after the last refit.
    lost = trial.robot.with_values(**{away[-1]: 1e7}).change(away[-1], free=True)
    full = in_full(replace(trial, robot=lost), logs, noise)
    assert not full.robot.parameters[away[-1]].free and abs(full[away[-1]].value) < 10.0


def test_a_held_height_has_the_value_of_the_nearest_that_is_told():
    axis = Axis()
    law = effect_by_id(axis, "asymmetric_viscous_friction", "shape")
    forward = [n for n in (axis + law).parameters.free_names if law.is_height(n) and n.endswith("forward")]
    robot = (axis + law).with_values(**{n: float(k) for k, n in enumerate(forward, start=1)})
    assert ran_away(robot) == [] and ran_away(robot.with_values(**{forward[1]: 1e13})) == [forward[1]]
    held = held_level(robot, forward[-2:]).parameters
    assert [held[n].value for n in forward[-3:]] == [len(forward) - 2] * 3
    assert [held[n].free for n in forward[-3:]] == [True, False, False]
    assert held_level(robot, []).parameters == robot.parameters
