"""Every effect of the catalogue against the independent simulator: same constants, same inputs, same motion.

One model holds all effects; each lane of one compiled program switches a single one on.
"""

import numpy as np
import pytest

pytest.importorskip("numba")
from benchmarks.hidden.cases import LARGEST_INPUT, MODEL, NOISE, REFERENCE, effect  # noqa: E402
from benchmarks.naming import true_parameters  # noqa: E402
from jaxid import Integrator, Log, LogSet
from jaxid.effects import catalogue
from jaxid.simulation.simulate import simulate_models
from reference import excitation  # noqa: E402
from reference.effects import EFFECTS, NOT_FOR  # noqa: E402
from reference.logs import simulate_log  # noqa: E402

SAMPLING, SAMPLES = 0.02, 500
SIZES = {
    "actuator_dead_zone": 0.6,
    "voltage_saturation": 0.3,
    "battery_sag": 0.3,
    "motor_lag": 0.04,
    "input_delay": 0.033,
    "motor_gain_mismatch": 0.06,
    "motor_heating": 1e-3,
    "stribeck_friction": 0.3,
    "asymmetric_friction": 0.4,
    "asymmetric_viscous_friction": 0.4,
    "sublinear_viscous_friction": 0.4,
    "cogging_torque": 0.3,
    "wheel_radius_mismatch": 0.06,
    "traction_limit": 1 / 20.0,
    "surface_change": 0.5,
    "ground_slope": 0.03,
    "quadratic_drag": 6.0,
    "lateral_com_offset": 0.03,
    "sensor_bias": 0.05,
    "sensor_scale": 0.08,
    "sensor_lag": 0.04,
    "sensor_delay": 0.033,
}
OMNI_SIZES = {
    "asymmetric_viscous_friction": 0.9,
    "sublinear_viscous_friction": 0.65,
    "motor_heating": 3e-3,
    "traction_limit": 1 / 45.0,
    "quadratic_drag": 20.0,
    "cogging_torque": 0.4,
    "wheel_radius_mismatch": 0.2,
}
NOT_THE_SAME = {
    # The omni's Stribeck rise acts along V, Vn, W in both, but with another lever for W; the axis has no power stage.
    "omni": {"stribeck_friction"},
    "pioneer": set(),
}


def names(robot: str) -> list[str]:
    """Effects that both sides have with the same meaning."""
    here = {e.id for e in catalogue(MODEL[robot]())}
    return [n for n in SIZES if n in here and n in EFFECTS and n not in NOT_FOR[robot] and n not in NOT_THE_SAME[robot]]


def in_model_terms(robot: str, name: str, p: dict[str, float]) -> dict[str, float]:
    """The effect's constants as parameters of the model with all effects."""
    if name == "cogging_torque":
        own = {f"sine_{angle}": p["amplitude"] for angle in MODEL[robot]().angles}
        return {f"{name}.{k}": v for k, v in {**own, "periods": p["periods"]}.items()}
    if name == "lateral_com_offset" and robot == "omni":
        J, M = REFERENCE[robot].parameters["J"], REFERENCE[robot].parameters["M"]
        # The simulator's J is about the body's origin, the model's about the centre of mass.
        return {"yc": p["offset"], "J": J - M * p["offset"] ** 2}
    own = dict(true_parameters(robot, {name: p})[name])
    if name == "surface_change":
        own |= {"angle": p["angle"], "offset": p["offset"]}
    frees = {"wheel_radius_mismatch", "lateral_com_offset"}
    return own if name in frees else {f"{name}.{k}": v for k, v in own.items()}


@pytest.fixture(scope="module", params=["pioneer", "omni"])
def both(request):
    """(robot, {effect: (model [T, ny], simulator [T, ny])}, and without any effect under "")."""
    robot = request.param
    model = MODEL[robot]()
    reference = REFERENCE[robot]
    shared = {k: float(v) for k, v in reference.parameters.items() if k in model.parameters}
    model = model.with_values(**shared)
    full = model
    for e in catalogue(model):
        full = full + e
    rng = np.random.default_rng(3)
    inputs = excitation.experiment(robot, "multilevel", SAMPLES, 11)
    changes, hidden = [{}], [{}]
    for name in names(robot):
        size = OMNI_SIZES.get(name, SIZES[name]) if robot == "omni" else SIZES[name]
        p = effect(robot, name, size, rng)
        if name == "surface_change":
            p |= {"offset": -0.3}  # from the start on, until the robot has driven out of it
        changes.append(in_model_terms(robot, name, p))
        hidden.append({name: p})
    base = full.parameters.numbers
    keys = sorted({k for change in changes for k in change})
    missing = [k for k in keys if k not in base]
    assert not missing, missing
    models = [full.with_values(**change) for change in changes]
    still = np.zeros((SAMPLES, len(model.channels.outputs)))
    logs = LogSet([Log.from_arrays("multilevel", SAMPLING * np.arange(SAMPLES), inputs, still, model)])
    at_rest = {name: np.zeros(1) for name in full.states}
    (outputs,) = simulate_models(models, logs, start=at_rest, integrator=Integrator(4))
    columns = [model.channels.measured.index(c) for c in model.channels.outputs]
    seen = {}
    for lane, effects in enumerate(hidden):
        table = simulate_log(reference, inputs, SAMPLING, 0.0, 0, effects=effects)
        truth = table[list(model.channels.outputs)].to_numpy()
        seen[next(iter(effects), "")] = (outputs[lane][:, columns], truth)
    return robot, seen


def test_no_effect_is_the_plain_robot(both):
    """All effects present at zero: the simulator's motion to a twentieth of the noise."""
    robot, seen = both
    ours, theirs = seen[""]
    assert np.sqrt(np.mean(((ours - theirs) / NOISE[robot]) ** 2)) < 0.05


def test_every_effect_moves_the_robot_as_the_simulator_says(both):
    """Each effect changes the motion by more than the noise, and what is left between the two is a tenth of that or less."""
    robot, seen = both
    plain = seen[""][1]
    wrong = []
    for name in names(robot):
        ours, theirs = seen[name]
        size = np.sqrt(np.mean(((theirs - plain) / NOISE[robot]) ** 2))
        left = np.sqrt(np.mean(((ours - theirs) / NOISE[robot]) ** 2))
        assert size > 1.0, f"{name} is too small to test: {size:.2f} times the noise"
        if left > 0.1 * size:
            wrong.append(f"{name}: {left:.3f} of {size:.2f} times the noise")
    assert not wrong, "; ".join(wrong)


def test_largest_inputs_are_what_limits_are_measured_by():
    """The strengths of a supply limit are shares of about the largest input."""
    for robot, largest in LARGEST_INPUT.items():
        inputs = excitation.experiment(robot, "prbs_reversing", SAMPLES, 3)
        assert 0.5 * largest < np.max(np.abs(inputs)) <= 1.2 * largest
