"""The search: what a model keeps of its effects when others are taken out or exchanged."""

import numpy as np

from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.refits.refit import Trial
from jaxid.explanation.search.reconsider import with_effects, with_trials
from jaxid.explanation.search.steps import Step
from jaxid.robots import Axis


def test_an_effect_moved_to_another_model_keeps_its_values_and_what_was_held():
    base = Axis()
    curve = effect_by_id(base, "stribeck_friction", "shape")
    other = effect_by_id(base, "quadratic_drag")
    owner = base + curve
    own = [name for name in owner.parameters if name.startswith("stribeck_friction.")]
    fixed = [name for name in own if not owner.parameters[name].free]
    heights = [name for name in own if owner.parameters[name].free]
    assert fixed and len(heights) > 1
    reach = 0.5 * owner.parameters[fixed[0]].value
    owner = owner.with_values(**{fixed[0]: reach, heights[0]: 0.0123}).change(heights[1], free=False) + other

    moved = with_effects(base, {"stribeck_friction": owner})

    assert [effect.id for effect in moved.effects] == ["stribeck_friction"]
    assert moved.parameters[fixed[0]].value == reach
    assert moved.parameters[heights[0]].value == 0.0123
    assert heights[1] not in moved.parameters.free_names and heights[0] in moved.parameters.free_names


def test_effects_that_the_model_has_are_left_as_they_are():
    base = Axis() + effect_by_id(Axis(), "quadratic_drag")
    name = next(name for name in base.parameters if name.startswith("quadratic_drag."))
    owner = base.with_values(**{name: 0.5})
    assert with_effects(base, {"quadratic_drag": owner}).parameters[name].value == base.parameters[name].value


def trial(effect, residual):
    state = HeldOut(float(np.sqrt(np.mean(residual**2))), {"v": 1.0}, (residual[:, None],), {"v": 1.0}, 0.0)
    return Trial(effect.id, Axis() + effect, float(np.sum(residual**2)), 5, state, lambda: state, {})


def test_laws_are_said_alike_of_the_effect_that_they_are_laws_of():
    noise = np.random.default_rng(0).normal(size=4000)
    drag = trial(effect_by_id(Axis(), "quadratic_drag"), 1.2 * noise)
    other = trial(effect_by_id(Axis(), "stribeck_friction"), noise)
    step = Step((drag,), (), (), drag, drag, (drag,), ("whole_speed",))
    exchanged = with_trials(step, [other, drag])
    assert exchanged.chosen is other and exchanged.laws == (other,) and exchanged.laws_alike == ()
    assert exchanged.equivalent == ()  # told apart
    assert with_trials(step, [drag]).laws_alike == ("whole_speed",)
