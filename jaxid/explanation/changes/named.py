"""What a refit found to have changed, in words and numbers."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...estimate.result import Estimate, Status
from .candidates import Candidate
from .change import Difference, NamedChange
from .first_look import FirstLook
from .joint import Pair, with_candidate
from .trials import Trial


def named(pair: Pair, trial: Trial, rows: int, look: FirstLook) -> NamedChange:
    """The change; of two together the parts besides, each with the other names of the same model."""
    candidate, joint = trial.score.candidate, trial.joint
    robot = with_candidate(pair.robot, candidate)
    numbers = {**robot.parameters.numbers, **dict(zip(pair.free, map(float, joint.theta), strict=True))}
    errors = np.sqrt(np.maximum(np.diag(joint.covariance), 0.0))
    found = {}
    for c, size, error in zip(candidate.coordinates, joint.delta, errors, strict=True):
        known = bool(np.isfinite(error) and error > 0)  # none of what no sample asks for
        status: Status = "identified" if known else "not_identifiable"
        estimate = Estimate.of(float(size), float(error) if known else float("nan"), c.unit, status)
        shared = numbers[c.of] if c.of else 0.0
        found[c.name] = Difference(shared, shared + float(size), estimate)
    if candidate.side == "before":
        found = {name: Difference(d.after, d.before, _negative(d.size)) for name, d in found.items()}
    rms = float(np.sqrt(joint.squares / rows))
    same = {score.candidate: score.same for score in look.scores}
    parts = tuple(_said(part, found, rms, same.get(part, ())) for part in candidate.parts)
    return _said(candidate, found, rms, trial.score.same, parts)


def _said(
    candidate: Candidate,
    found: Mapping[str, Difference],
    rms: float,
    same: tuple[str, ...],
    parts: tuple[NamedChange, ...] = (),
) -> NamedChange:
    own = {c.name: found[c.name] for c in candidate.coordinates}
    law, formula = candidate.law
    return NamedChange(candidate.id, candidate.title, own, rms, same, parts, law, formula)


def _negative(size: Estimate) -> Estimate:
    """The same with the other sign."""
    low, high = size.ci95
    return replace(size, value=-size.value, ci95=(-high, -low))
