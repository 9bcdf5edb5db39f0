"""What is said of the robot's own parameters where the model with what was added is still not the robot, on an axis in closed
form whose gear slips: no law of the catalogue, but a loss of large forces."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error

MASS, VISCOUS = 2.4, 1.7


@pytest.fixture(scope="module")
def explained():
    """An axis whose drive transmits all of a force up to 3 N and 55 % of a larger one; forces about 3 N are held out alone."""
    logs = []
    for k in range(5):
        rng = np.random.default_rng([71, k])
        levels = rng.uniform(-4, 4, 400)
        levels = levels if k > 2 else levels[(np.abs(levels) < 2.3) | (np.abs(levels) > 3.7)]
        u = np.repeat(levels[:80], 10)
        decay, v, found = np.exp(-VISCOUS / MASS * 0.02), 0.0, []
        for force in np.where(np.abs(u) > 3.0, 0.55 * u, u):
            found.append(v)
            v = force / VISCOUS + (v - force / VISCOUS) * decay
        outputs = {"v": np.array(found) + 0.003 * rng.normal(size=len(u))}
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(len(u)), u[:, None], outputs, AXIS))
    fitted, held_out = LogSet(logs[:3]), LogSet(logs[3:])
    robot = Axis().with_values(Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)
    return explain(output_error(robot, fitted), fitted, held_out, most=1)


@pytest.mark.slow
def test_a_curve_of_what_is_lost_takes_no_share_of_the_forces_that_are_not(explained):
    # A loss of every force in proportion is another mass and another friction: it must not be the curve's.
    assert [effect.id for effect in explained.effects][:1] in (["traction_limit"], ["voltage_saturation"])
    assert explained.final["M"].value == pytest.approx(MASS, rel=0.03)
    assert explained.final["Fv"].value == pytest.approx(VISCOUS, rel=0.03)
    assert abs(explained.baseline["M"].value / MASS - 1.0) > 0.3


@pytest.mark.slow
def test_parameters_of_a_model_that_held_out_logs_refute_are_doubted(explained):
    assert explained.verdict == "unexplained" and explained.after.normalised_rms > 2.0
    final = explained.final
    assert not final.trustworthy and "held-out logs" in final.judgement.sentence
    assert final.status_of("M") == "identified, of a poor model" == final.to_pandas().loc["M", "status"]
    rows = [line for line in repr(explained).splitlines() if line.startswith(("M ", "Fv "))]
    assert rows and all(" ?" in row for row in rows)
