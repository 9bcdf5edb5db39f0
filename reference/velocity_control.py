"""The omni robot under velocity control, as its paper drives it: sampled PI control of V, Vn and W.

    measured speeds -> PI of each axis -> duties of four motors, limited to +-255 -> voltages -> motor currents

The controller sees the wheels' encoders, whose noise is not that of the log's speeds (the paper has an external vision
system beside them). The driver lowers the voltage wherever a motor would draw more than the current limit. The paper
prints neither: structure and numbers are assumptions.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from reference.logs import simulate
from reference.robot import Robot

LARGEST_DUTY = 255.0
SUPPLY = 24.0  # V at the largest duty
# Row: motor; column: V, Vn, W. A wheel's part in an axis has the sign of its rim speed.
MIX = np.array([[0, 1, 1], [-1, 0, 1], [0, -1, 1], [1, 0, 1]])


@dataclass(frozen=True)
class VelocityControl:
    """Gains of V, Vn [duty per m/s, per m] and W [duty per rad/s, per rad]; an integrator stands while a duty of its
    axis is at the limit."""

    proportional: tuple[float, float, float] = (600.0, 600.0, 14.0)
    integral: tuple[float, float, float] = (1000.0, 1000.0, 120.0)
    current_limit: float = 6.0
    sampling: float = 0.02
    encoder_noise: tuple[float, float, float] = (0.002, 0.002, 0.01)  # m/s, m/s, rad/s

    def duty(self, error: np.ndarray, memory: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Duties (4,) and the integrators (3,) after this sample, from the speed errors (3,)."""
        wanted = MIX @ (np.array(self.proportional) * error + memory)
        driving = (MIX != 0) & (np.abs(wanted) > LARGEST_DUTY)[:, None]
        grown = memory + np.array(self.integral) * self.sampling * error
        return np.clip(wanted, -LARGEST_DUTY, LARGEST_DUTY), np.where(driving.any(axis=0), memory, grown)


def controlled_log(
    robot: Robot,
    reference: np.ndarray,
    noise: tuple[float, float, float],
    seed: int,
    current_noise: float,
    control: VelocityControl | None = None,
) -> tuple[pd.DataFrame, np.ndarray]:
    """A log (t, u1..u4 as commanded, V, Vn, W, i1..i4) of `reference` (N, 3) from rest, and the exact states (N, n).

    Row k holds the speeds measured at t_k, the voltages chosen from them, and the currents just after t_k.
    """
    control = control or VelocityControl()
    limited = robot.with_parameters(current_limit=control.current_limit)
    rng = np.random.default_rng(seed)
    encoder_noise = rng.standard_normal((len(reference), 3)) * control.encoder_noise
    state, memory = np.zeros(robot.n_states), np.zeros(3)
    rows, states = [], []
    for k, wanted in enumerate(reference):
        states.append(state)
        duty, memory = control.duty(wanted - state[3:6] - encoder_noise[k], memory)
        volts = np.tile(duty / LARGEST_DUTY * SUPPLY, (2, 1))
        run = simulate(limited, volts, control.sampling, start=dict(enumerate(state)))
        rows.append((k * control.sampling, *volts[0], *state[3:6], *run.currents[0]))
        state = run.states[-1]
    table = pd.DataFrame(rows, columns=["t", "u1", "u2", "u3", "u4", "V", "Vn", "W", "i1", "i2", "i3", "i4"])
    table[["V", "Vn", "W"]] += rng.standard_normal((len(table), 3)) * noise
    table[["i1", "i2", "i3", "i4"]] += rng.standard_normal((len(table), 4)) * current_noise
    return table, np.array(states)
