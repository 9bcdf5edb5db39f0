"""A cart whose right wheel rubs more, by Euler's rule with true sticking, taken for friction that falls off with speed."""

import numpy as np

from jaxid import DifferentialDrive, Log, LogSet
from jaxid.effects import effect_by_id
from jaxid.explanation.refits.refit import refit
from jaxid.explanation.search.at_the_same_place import by_others_at_the_same_place
from jaxid.explanation.search.steps import Search, Step
from jaxid.simulation.scaled import scaled_to

M, J, B, FV, RIGHT, LEFT = 2.0, 0.05, 0.2, 1.5, 0.75, 0.45
NOISE = {"v": 0.003, "w": 0.005}
H = 2e-3


def cart(name, seed):
    random = np.random.default_rng(seed)
    u = np.repeat(random.uniform(-3.0, 3.0, (40, 2)), 10, axis=0)
    speeds, seen = np.zeros(2), []  # of the right and of the left wheel
    together, apart = 1.0 / M + B**2 / J, 1.0 / M - B**2 / J
    mobility = np.array([[together, apart], [apart, together]])
    limits = np.array([RIGHT, LEFT])
    for force in u:
        seen.append((speeds.mean(), (speeds[0] - speeds[1]) / (2.0 * B)))
        for _ in range(round(0.02 / H)):
            free = speeds + H * mobility @ (force - FV * speeds)
            friction = np.zeros(2)
            for _ in range(6):  # what stops the wheels within the step, as far as it reaches, one after the other
                for k in range(2):
                    rest = free - H * mobility @ friction
                    friction[k] = np.clip(friction[k] + rest[k] / (H * mobility[k, k]), -limits[k], limits[k])
            speeds = free - H * mobility @ friction
    shown = np.array(seen) + random.normal(size=(len(u), 2)) * list(NOISE.values())
    return Log.from_arrays(name, 0.02 * np.arange(len(u)), u, shown, "differential")


def test_friction_that_falls_off_at_no_speed_of_one_wheel_is_a_wheel_that_rubs_more():
    logs, held_out = LogSet([cart("a", 1), cart("b", 2)]), LogSet([cart("c", 3)])
    robot = scaled_to(DifferentialDrive().with_values(M=M, J=J, b=B, Fv=FV, Fc=LEFT), logs)

    def fitted(model, **start):
        own = {name: model.parameters[name].value for name in model.parameters.free_names}
        return refit(model, [own | start], logs, held_out, NOISE, {})

    base = fitted(robot)
    falling = robot + effect_by_id(robot, "stribeck_friction", "per_axis")
    amplitudes = {"stribeck_friction.amplitude_1": RIGHT - LEFT, "stribeck_friction.amplitude_2": 0.0}
    taken = fitted(falling, **amplitudes, **{"stribeck_friction.speed": 20.0})
    assert taken.held_out.normalised_rms < 1.05  # nothing is wrong with what it predicts
    step = Step((taken,), (), (), base, taken)
    said = []
    found = Search(base.held_out, taken.held_out, taken, (step,), ())
    instead = by_others_at_the_same_place(found, ["stribeck_friction"], [], logs, held_out, said.append)
    assert instead.steps[0].chosen.title == "asymmetric_friction (between_axes)" and not instead.steps[0].equivalent
    assert instead.final.free < taken.free and instead.final.held_out.normalised_rms < 1.05
    numbers = instead.final.robot.parameters.numbers
    difference = abs(numbers["asymmetric_friction.difference_1"])
    assert abs(difference - (RIGHT - LEFT) / (RIGHT + LEFT)) < 0.01
    assert any("instead of Stribeck friction" in sentence for sentence in said)
    assert by_others_at_the_same_place(found, [], [], logs, held_out, said.append) == found


def test_what_is_the_likelier_model_stays():
    """Friction that does fall off: nothing else that acts there follows it."""
    logs, held_out = LogSet([cart("a", 1), cart("b", 2)]), LogSet([cart("c", 3)])
    robot = scaled_to(DifferentialDrive().with_values(M=M, J=J, b=B, Fv=FV, Fc=LEFT), logs)
    uneven = robot + effect_by_id(robot, "asymmetric_friction", "between_axes")
    own = {name: uneven.parameters[name].value for name in uneven.parameters.free_names}
    base = refit(robot, [{n: v for n, v in own.items() if n in robot.parameters}], logs, held_out, NOISE, {})
    right = refit(uneven, [own], logs, held_out, NOISE, {})
    found = Search(base.held_out, right.held_out, right, (Step((right,), (), (), base, right),), ())
    after = by_others_at_the_same_place(found, ["asymmetric_friction"], [], logs, held_out, lambda said: None)
    assert after.final is right and after.steps == found.steps
