"""Laws of the catalogue against the independent simulator's laws of the same formula: same constants and inputs, same motion.

The simulator's laws were written from the literature, by another integrator and with true dry friction.
"""

import numpy as np
import pytest

pytest.importorskip("numba")
from benchmarks.hidden.cases import MODEL, NOISE, REFERENCE  # noqa: E402
from jaxid import Integrator, Log, LogSet
from jaxid.effects import catalogue, effect_by_id, laws_of
from jaxid.explanation.screening.probes import standing_together
from jaxid.simulation.simulate import simulate
from reference import excitation  # noqa: E402
from reference.law_forces import CREEPING  # noqa: E402
from reference.logs import simulate_log  # noqa: E402

SAMPLING, SAMPLES = 0.02, 400
_P = REFERENCE["pioneer"].parameters
FORCE_OF_A_VOLT = _P["tr"] * _P["mu"] * _P["KT"] / (_P["R"] * _P["Ra"])
"""Of one wheel at standstill [N/V]."""
LAWS = {
    # the simulator's law: (its constants, the law here, the same constants here)
    "stribeck_friction/exponential": (
        {"amplitude": 0.6, "speed": 0.06},
        "exponential",
        {"amplitude": 0.6, "speed": 0.06},
    ),
    "stribeck_friction/lorentzian": (
        {"amplitude": 0.6, "speed": 0.06},
        "lorentzian",
        {"amplitude": 0.6, "speed": 0.06},
    ),
    "stribeck_friction/root": (
        {"amplitude": 0.6, "speed": 0.06},
        "exponent_one_half",
        {"amplitude": 0.6, "speed": 0.06},
    ),
    "motor_gain_mismatch/torque_constant": ({"mismatch": 0.08, "motor": 1.0}, "torque_constant", {"gain_V2": 0.08}),
    "motor_gain_mismatch/winding_resistance": (
        {"mismatch": 0.1, "motor": 2.0},
        "winding_resistance",
        {"excess_V3": 0.1},
    ),
    "traction_limit/tanh": ({"inverse_limit": 0.03}, "tanh", {"inverse_limit": 0.03}),
    "traction_limit/one_wheel": ({"inverse_limit": 0.05, "wheel": 2.0}, "per_wheel", {"inverse_limit_2": 0.05}),
    "asymmetric_friction/one_wheel": ({"asymmetry": 0.4, "wheel": 1.0}, "per_axis", {"asymmetry_1": 0.4}),
    "asymmetric_viscous_friction/one_wheel": ({"asymmetry": 0.8, "wheel": 2.0}, "per_axis", {"asymmetry_2": 0.8}),
    "sublinear_viscous_friction/tanh": ({"curvature": 6.0}, "tanh", {"inverse_speed": 6.0}),
    "actuator_dead_zone/threshold": ({"threshold": 1.5}, "threshold", {"threshold": 1.5}),
    "actuator_dead_zone/unequal": (
        {"threshold": 0.8, "ratio": 0.4},
        "unequal_edges",
        {"threshold_forward": 0.8, "threshold_backward": 0.32},
    ),
    "actuator_dead_zone/one_motor": ({"threshold": 0.8, "motor": 1.0}, "per_motor", {"threshold_V2": 0.8}),
    "voltage_saturation/tanh": ({"inverse_limit": 0.06}, "tanh", {"inverse_limit": 0.06}),
    "voltage_saturation/unequal": ({"inverse_limit": 0.2}, "unequal_limits", {"inverse_limit_forward": 0.2}),
    "battery_sag/total_current": ({"resistance": 0.1, "nominal": 12.0}, "sum_of_currents", {"resistance": 0.1}),
    "motor_heating/cooling": (
        {"coefficient": 2e-3, "time": 3.0},
        "with_cooling",
        {"coefficient": 2e-3, "time_constant": 3.0},
    ),
    "motor_heating/torque_constant": ({"coefficient": 1e-3}, "torque_constant", {"coefficient": 1e-3}),
    "motor_lag/inductance": ({"time_constant": 0.04}, "inductance", {"time_constant": 0.04}),
    "motor_lag/one_motor": ({"time_constant": 0.05, "motor": 2.0}, "per_motor", {"time_constant_V3": 0.05}),
    "motor_lag/slew": ({"time_per_volt": 0.03}, "ramp", {"time_per_unit": 0.03}),
    "input_delay/one_motor": ({"delay": 0.05, "motor": 1.0}, "per_input", {"delay_V2": 0.05}),
    "sensor_lag/second_order": ({"time_constant": 0.06}, "second_order", {"time_constant": 0.06}),
    "sensor_lag/one_channel": ({"time_constant": 0.06, "channel": 2.0}, "per_channel", {"time_constant_eta2": 0.06}),
    "sensor_lag/moving_average": ({"time_constant": 0.05}, "moving_average", {"window": 0.1}),
    "sensor_delay/one_channel": ({"delay": 0.05, "channel": 1.0}, "per_channel", {"delay_eta1": 0.05}),
    "turning_friction/scrub": ({"moment": 0.3, "radius": 0.3}, "by_turn_radius", {"coulomb": 0.3, "radius": 0.3}),
    "sensor_delay/growing": ({"delay": 0.05}, "growing", {"rate": 0.1 / (SAMPLING * (SAMPLES - 1))}),
    "input_delay/growing": ({"delay": 0.05}, "growing", {"rate": 0.1 / (SAMPLING * (SAMPLES - 1))}),
    "sensor_bias/drifting": (
        {"bias": 0.1, "channel": 1.0},
        "drifting",
        {"drift_eta1": 0.1 / (SAMPLING * (SAMPLES - 1))},
    ),
    "sensor_scale/one_direction": ({"error": 0.1, "channel": 2.0}, "by_direction", {"error_eta2": 0.1}),
    "sensor_cross_talk/misaligned": (
        {"angle": 0.1, "channel": 1.0, "other": 2.0},
        "proportional",
        {"share_eta1_of_eta2": 0.1},
    ),
    "freewheeling_driver/no_braking": ({"share": 0.6}, "against_the_command", {"share": 0.6}),
    "traction_limit/creep": (
        {"creep": 0.03},
        "creep_at_rest",
        {"slip": 0.03 * FORCE_OF_A_VOLT, "at_rest": CREEPING * _P["KE"] * _P["tr"] / _P["R"]},
    ),
    "backlash/command": ({"width": 1.5}, "command", {"width": 1.5}),
    "payload_change/leaking": ({"mass": 4.0, "time": 6.0}, "leaking", {"mass": 4.0, "time": 6.0}),
    "cogging_torque/by_current": (
        {"share": 0.3, "periods": 4.0},
        "share_of_torque",
        {"sine_phi2": 0.3, "sine_phi3": 0.3, "periods": 4.0},
    ),
}


def rms(errors, robot):
    """In units of the nominal noise."""
    return float(np.sqrt(np.mean((errors / NOISE[robot]) ** 2)))


@pytest.fixture(scope="module")
def plain():
    """Model, inputs, and what the simulator says without any law."""
    reference, model = REFERENCE["pioneer"], MODEL["pioneer"]()
    model = model.with_values(**{k: float(v) for k, v in reference.parameters.items() if k in model.parameters})
    inputs = excitation.experiment("pioneer", "multilevel", SAMPLES, 11)
    table = simulate_log(reference, inputs, SAMPLING, 0.0, 0)
    return model, inputs, table[list(model.channels.outputs)].to_numpy()


def _first_of_their_mechanism_by_default():
    """Every law is asked; by default the first of each mechanism."""
    seen = set()
    for law in LAWS:
        mechanism = law.split("/")[0]
        yield pytest.param(law, marks=pytest.mark.slow if mechanism in seen else [])
        seen.add(mechanism)


@pytest.mark.parametrize("law", list(_first_of_their_mechanism_by_default()))
def test_law_moves_the_robot_as_the_simulator_says(plain, law):
    model, inputs, without = plain
    theirs, own_law, ours = LAWS[law]
    effect = effect_by_id(model, law.split("/")[0], own_law).sharp
    robot = model + effect
    robot = robot.with_values(**{effect.key(name): value for name, value in ours.items()})
    still = np.zeros((SAMPLES, len(model.channels.outputs)))
    logs = LogSet([Log.from_arrays("one", SAMPLING * np.arange(SAMPLES), inputs, still, model)])
    (found,) = simulate(robot, logs, integrator=Integrator(4))
    truth = simulate_log(REFERENCE["pioneer"], inputs, SAMPLING, 0.0, 0, laws={law: theirs})
    truth = truth[list(model.channels.outputs)].to_numpy()
    size = rms(truth - without, "pioneer")
    assert size > 1.0, f"too small to test: {size:.2f} times the noise"
    assert rms(found[:, :2] - truth, "pioneer") < 0.1 * size


@pytest.mark.parametrize(
    "robot",
    [MODEL["axis"](), *(pytest.param(MODEL[name](), marks=pytest.mark.slow) for name in ("pioneer", "omni"))],
    ids=lambda robot: robot.name,
)
def test_every_law_at_its_first_values_is_no_effect(robot):
    """Within what its finer integration steps change; all laws of a mechanism stand in one model, as in a first look."""
    inputs = excitation.experiment(robot.name, "multilevel", 150, 11)
    still = np.zeros((150, len(robot.channels.outputs)))
    logs = LogSet([Log.from_arrays("one", SAMPLING * np.arange(150), inputs, still, robot)])
    steps = Integrator(2)
    (without,) = simulate(robot, logs, integrator=steps)
    for usual in catalogue(robot):
        model = robot
        for _, law in standing_together(laws_of(robot, usual.id)):
            model = model + law
        (found,) = simulate(model, logs, integrator=steps)
        assert np.max(np.abs(found - without)) < 1e-9, usual.id


def test_laws_of_one_mechanism_have_names_of_their_own():
    """And the same id, place and no two the same formula."""
    robot = MODEL["omni"]()
    for usual in catalogue(robot):
        laws = laws_of(robot, usual.id)
        assert len({law.law for law in laws}) == len({law.formula for law in laws}) == len(laws), usual.id
        assert {law.id for law in laws} == {usual.id} and len({law.where for law in laws}) == 1
