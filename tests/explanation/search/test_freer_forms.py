"""jaxid/explanation/search/freer_forms.py: a drag whose exponent is not two is still a drag."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, explain, output_error, read_logs
from jaxid.explanation.search.freer_forms import as_well_by_a_freer_form
from tests.explanation.search.test_telling_apart import residuals, trial  # noqa: F401


def test_a_formula_that_is_a_little_behind_is_asked_by_its_freer_form(residuals):  # noqa: F811
    right, other = residuals
    best, drag, base = trial("stribeck_friction", right), trial("quadratic_drag", other), trial("motor_lag", 10 * right)
    asked = []

    def again(robot, like, left):
        asked.append(robot)
        return replace(trial(like.id, left), robot=robot)

    found = as_well_by_a_freer_form([best, drag], base, lambda robot, like: again(robot, like, right))
    assert list(found) == ["quadratic_drag"] and found["quadratic_drag"].robot.effects[-1].law == "any_power"
    assert "quadratic_drag.exponent" in asked[0].parameters.free_names
    assert not as_well_by_a_freer_form([best, drag], base, lambda robot, like: again(robot, like, other))
    # One that is alike by its formula, one that is far behind, and a mechanism without such a form are not asked.
    asked.clear()
    far = trial("quadratic_drag", 3 * right)
    same, without = trial("quadratic_drag", right), trial("input_delay", other)
    for rival in (same, far, without):
        assert not as_well_by_a_freer_form([best, rival], base, lambda robot, like: again(robot, like, right))
    assert not asked


@pytest.mark.slow
def test_a_drag_with_an_exponent_of_its_own_stands_among_the_names(tmp_path):
    """15 N at 1 m/s, by semi-implicit steps of 0.2 ms: Stribeck friction that ends far from standstill is as near to it,
    and was the name, with dry friction 9 N off."""
    mass, viscous, coulomb, drag, h = 18.0, 14.0, 9.0, 15.0, 2e-4
    for number in range(5):
        rng = np.random.default_rng([7, number])
        t = 0.01 * np.arange(2000)
        force = np.repeat(rng.uniform(6.0, 26.0, 40) * rng.choice([-1.0, 1.0], 40), 50)
        v, speeds = 0.0, []
        for push in force:
            speeds.append(v)
            for _ in range(50):
                free = v + h / mass * (push - viscous * v - drag * abs(v) ** 1.6 * np.sign(v))
                v = np.sign(free) * max(abs(free) - h * coulomb / mass, 0.0)
        seen = np.array(speeds) + 0.004 * rng.normal(size=len(t))
        name = f"fit_{number}" if number < 3 else f"check_{number}"
        table = np.stack([t, force, seen], axis=1)
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header="t,u,v", comments="")
    logs, held_out = (read_logs(tmp_path / f"{kind}_*.csv", "axis") for kind in ("fit", "check"))
    found = explain(output_error(Axis(), logs), logs, held_out)
    names = {name for effect in found.effects for name in (effect.id, *effect.equivalent_to)}
    assert found.verdict in ("named", "ambiguous") and "quadratic_drag" in names, found.sentence
