"""The eight-experiment Pioneer problem, in NumPy: what every rival is given.

Eight logs of 1,000 samples at 50 Hz from the independent simulator in `reference/` (coupled Pioneer, dry friction that
really sticks), with white noise. Unknown are seven physical parameters and three initial states of each log; the rivals
minimise

    cost = 1/2 sum ((simulated - measured) / sigma)²  +  1/2 sum (beta(0) / 0.5 rad)²

16,000 residuals and eight weak priors on what no sensor shows, the caster's initial angle. All rivals move in the same
units: parameters over their published values, initial states over 0.1.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

SAMPLES, SAMPLING, SUBSTEPS = 1000, 0.02, 4
SIGMA = np.array([0.01, 0.02])  # m/s, rad/s
FREE = ("I0", "Ir1", "Ir", "Cs", "Cv", "Cs1", "Cv1")
STATES = ("beta", "eta1", "eta2")
STATE_SCALE = 0.1
BETA_SPREAD = 0.5  # rad
_PLAN = (
    ("prbs_forward", 8.0),
    ("prbs_reversing", 8.0),
    ("multilevel", 8.0),
    ("steps", 8.0),
    ("turning", 8.0),
    ("arcs", 8.0),
    ("multilevel", 6.0),
    ("prbs_reversing", 6.0),
)


@dataclass(frozen=True)
class FitProblem:
    """inputs and outputs [E, T, 2]; `numbers`: all physical parameters; `scale` and `start` [7] of the free ones."""

    inputs: np.ndarray
    outputs: np.ndarray
    numbers: dict[str, float]
    scale: np.ndarray
    start: np.ndarray

    @property
    def experiments(self) -> int:
        """Number of logs."""
        return len(self.inputs)

    @property
    def start_point(self) -> np.ndarray:
        """Start in the common units, [7 + 3 E]: parameters 10-20 % off, initial states at rest, caster trailing."""
        return np.concatenate([self.start / self.scale, np.zeros(3 * self.experiments)])

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Physical parameters [7] and initial states [E, 3] of a point in the common units."""
        return x[:7] * self.scale, STATE_SCALE * x[7:].reshape(self.experiments, 3)

    def save(self, path: Path) -> None:
        """Write to an .npz file."""
        names, values = zip(*self.numbers.items(), strict=True)
        np.savez(
            path,
            inputs=self.inputs,
            outputs=self.outputs,
            scale=self.scale,
            start=self.start,
            names=names,
            values=values,
        )

    @staticmethod
    def load(path: Path) -> "FitProblem":
        """Read what `save` wrote."""
        with np.load(path) as z:
            numbers = {str(k): float(v) for k, v in zip(z["names"], z["values"], strict=True)}
            return FitProblem(z["inputs"], z["outputs"], numbers, z["scale"], z["start"])


def make_problem(seed: int, samples: int = SAMPLES, experiments: int = len(_PLAN)) -> FitProblem:
    """Simulate the logs of `seed` and draw the start values.

    Every log begins with 1.2 s straight ahead and a caster within 0.1 rad of trailing.
    """
    from reference.excitation import experiment
    from reference.logs import simulate_log
    from reference.pioneer import PARAMETERS, PIONEER
    from reference.pioneer import STATES as REFERENCE_STATES

    rng = np.random.default_rng([seed, 7])
    beta = REFERENCE_STATES.index("beta")
    inputs, outputs = [], []
    for number, (kind, level) in enumerate(_PLAN[:experiments]):
        volts = experiment("pioneer", kind, samples, 100 * seed + number, level)
        begin = {beta: float(np.clip(0.04 * rng.standard_normal(), -0.1, 0.1))}
        log = simulate_log(PIONEER, volts, SAMPLING, tuple(SIGMA), 100 * seed + number, start=begin)
        inputs.append(volts)
        outputs.append(log[["eta1", "eta2"]].to_numpy())
    scale = np.array([PARAMETERS[name] for name in FREE])
    off = rng.uniform(0.1, 0.2, len(FREE)) * rng.choice([-1.0, 1.0], len(FREE))
    return FitProblem(np.array(inputs), np.array(outputs), dict(PARAMETERS), scale, scale * (1 + off))
