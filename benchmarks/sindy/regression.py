"""SINDy on what a baseline leaves: sparse regression of the residual acceleration, sparsity chosen on held-out logs."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pysindy
from scipy.ndimage import minimum_filter1d
from scipy.signal import savgol_filter

from jaxid.explanation.left.heldout import HeldOut, held_out_state
from jaxid.logs import Log, LogSet
from jaxid.robots.robot import Robot

from .model import columns, extended, library, with_coefficients


@dataclass(frozen=True)
class Setting:
    """How SINDy is set, chosen on the cases of the `fast` set alone.

    `window` samples of the smoothed differentiation (Savitzky-Golay, cubic) and `smoothing` samples of the same filter on
    the speeds that the library's functions get; `alpha` of STLSQ's ridge; `thresholds` of
    the optimizer, as the RMS of a term's share over that of the noise in the residual acceleration; `tolerance`: the
    sparsest answer whose held-out error is within this share of the best is taken, with one threshold first, then
    equation by equation in so many `sweeps`; `keep_every`-th sample of the smoothed signals goes into the regression;
    `own_free`: the model's own terms (viscous, Coulomb, gain) are regressed along and never thresholded; below `at_rest`
    times its noise a speed is taken for rest; of terms whose correlation is above `alike` the first stays; FROLS takes
    `most_terms` at most.
    """

    window: int = 21
    smoothing: int = 11
    alpha: float = 0.05
    thresholds: tuple[float, ...] = tuple(np.geomspace(0.05, 4.0, 20).tolist())
    tolerance: float = 0.05
    sweeps: int = 2
    keep_every: int = 3
    own_free: bool = True
    optimizer: Literal["STLSQ", "FROLS"] = "FROLS"
    most_terms: int = 12
    at_rest: float = 1.5
    alike: float = 0.999


@dataclass(frozen=True)
class Answer:
    """`coefficients` by (equation, term); the baseline's and the extended model's held-out errors."""

    coefficients: dict[tuple[str, str], float]
    before: HeldOut
    after: HeldOut


def _smoothed(robot: Robot, logs: LogSet, window: int) -> list[np.ndarray]:
    found = []
    for log in logs:
        speeds = np.column_stack([log.output(name) for name in robot.velocities])
        found.append(np.asarray(savgol_filter(speeds, window, 3, axis=0)))
    return found


def differentiated(signals: np.ndarray, time: np.ndarray, setting: Setting) -> np.ndarray:
    """PySINDy's smoothed derivative of `signals` [T, n]."""
    method = pysindy.SmoothedFiniteDifference(smoother_kws={"window_length": setting.window, "polyorder": 3})
    return np.asarray(method(signals, time))  # pyright: ignore[reportArgumentType]: declared as int, takes times


def _sliding(robot: Robot, log: Log, setting: Setting, noise: Mapping[str, float]) -> np.ndarray:
    """[T, velocities]: whether what each equation rubs on slides all through the window around a sample.

    What sticks does not move whatever the inputs are; no function of states and inputs can say that.
    """
    speeds = np.column_stack([log.output(name) for name in robot.velocities])
    smooth = np.asarray(savgol_filter(speeds, setting.smoothing, 3, axis=0))
    level = np.array([noise[name] for name in robot.velocities])
    if robot.name == "pioneer":  # both equations hold both wheels
        L = robot.parameters["L"].value
        smooth = np.stack([smooth[:, 0] + L * smooth[:, 1], smooth[:, 0] - L * smooth[:, 1]], 1)
        level = np.full(2, np.hypot(level[0], L * level[1]))
    slides = np.abs(smooth) > setting.at_rest * level
    if robot.name == "pioneer":
        slides = np.repeat(slides.all(axis=1, keepdims=True), 2, axis=1)
    return minimum_filter1d(slides, setting.window, axis=0)


def regression_data(
    robot: Robot, logs: LogSet, setting: Setting, noise: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residual acceleration [N, velocities], library [N, terms] and rows that slide [N, velocities], of all logs.

    The model's acceleration and the terms are integrated before they are differentiated as the measured speeds are, so
    that steps of the inputs between two samples and the smoothing itself leave no error.
    """
    targets, libraries, slides = [], [], []
    edge = setting.window
    for log, (model, terms) in zip(logs, columns(robot, logs, _smoothed(robot, logs, setting.smoothing)), strict=True):
        speeds = np.column_stack([log.output(name) for name in robot.velocities])
        time = np.asarray(log.time)
        rows = slice(edge, -edge, setting.keep_every)
        targets.append(differentiated(speeds - model, time, setting)[rows])
        libraries.append(differentiated(terms, time, setting)[rows])
        slides.append(_sliding(robot, log, setting, noise)[rows])
    return np.concatenate(targets), np.concatenate(libraries), np.concatenate(slides)


def _stlsq(target: np.ndarray, terms: np.ndarray, setting: Setting) -> list[np.ndarray]:
    """For every threshold the mask of the terms that sequentially thresholded least squares keeps."""
    masks = []
    for threshold in setting.thresholds:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # "all coefficients eliminated" is an answer here
            found = pysindy.STLSQ(threshold=threshold, alpha=setting.alpha, unbias=False).fit(terms, target[:, None])
        masks.append(np.ravel(found.coef_) != 0)
    return masks


def _frols(target: np.ndarray, terms: np.ndarray, setting: Setting) -> list[np.ndarray]:
    """For every threshold the mask of the terms that forward regression takes in while each explains more than it.

    The threshold is squared: what a term has to explain of the target's variance, in units of the noise's.
    """
    found = pysindy.FROLS(max_iter=min(setting.most_terms, terms.shape[1] - 1), alpha=0.0, unbias=False)
    found.fit(terms, target[:, None])
    order = [np.ravel(step) != 0 for step in found.history_]  # the i-th entry holds the first i terms
    explained = found.ERR_global[:, 0] * float(target @ target)
    masks = []
    for threshold in setting.thresholds:
        worth = np.flatnonzero(explained[: len(order) - 1] < threshold**2)
        masks.append(order[int(worth[0]) if worth.size else len(order) - 1])
    return masks


def acceleration_noise(setting: Setting, sampling_interval: float) -> float:
    """Standard deviation of the smoothed derivative of white noise of unit standard deviation [1/s]."""
    white = np.random.default_rng(0).standard_normal((20000, 1))
    return float(np.std(differentiated(white, sampling_interval * np.arange(len(white)), setting)))


def sparse(target: np.ndarray, terms: np.ndarray, own: np.ndarray, noise: float, setting: Setting) -> list[np.ndarray]:
    """For every threshold the mask [terms] of those that survive in one equation.

    Terms are scaled to unit norm and the target by its noise, so that one threshold means the same in all equations.
    With `own_free` the own terms are projected off first (the same as regressing them along without a threshold).
    """
    y, X = target, terms
    free = own if setting.own_free else np.zeros_like(own)
    if free.any():
        basis = np.linalg.qr(terms[:, free])[0]
        y, X = y - basis @ (basis.T @ y), X - basis @ (basis.T @ X)
    size = np.linalg.norm(X, axis=0)
    use = ~free & (size > 1e-6 * np.linalg.norm(terms, axis=0)) & (size > 0)
    alike = np.abs(np.triu((X / np.where(use, size, 1.0)).T @ (X / np.where(use, size, 1.0)), 1)) > setting.alike
    use &= ~alike[use].any(axis=0)  # of columns that these logs cannot tell apart the first stays
    search = {"STLSQ": _stlsq, "FROLS": _frols}[setting.optimizer]
    masks = []
    for chosen in search(y / (noise * np.sqrt(len(y))), X[:, use] / size[use], setting):
        mask = np.zeros(terms.shape[1], bool)
        mask[use] = chosen
        masks.append(mask)
    return masks


def weights(target: np.ndarray, terms: np.ndarray, kept: np.ndarray, own: np.ndarray, setting: Setting) -> np.ndarray:
    """Least-squares coefficients [terms] of the surviving terms, with the own ones along where they are free."""
    coefficients = np.zeros(terms.shape[1])
    chosen = kept | own if setting.own_free else kept
    scale = np.linalg.norm(terms[:, chosen], axis=0)
    scale[scale == 0] = 1.0
    coefficients[chosen] = np.linalg.lstsq(terms[:, chosen] / scale, target, rcond=1e-10)[0] / scale
    return coefficients


def identify(
    robot: Robot, logs: LogSet, held_out: LogSet, setting: Setting, noise: Mapping[str, float] | None = None
) -> Answer:
    """SINDy's answer: terms whose threshold the held-out logs chose, simulated as additional accelerations."""
    names = library(robot)
    base = extended(robot)
    before = held_out_state(base, held_out, noise)
    target, terms, slides = regression_data(base, logs, setting, before.noise)
    own = {e: np.array([e in term.own for term in names.values()]) for e in robot.velocities}
    data = {e: (target[slides[:, i], i], terms[slides[:, i]]) for i, e in enumerate(robot.velocities)}
    gain = acceleration_noise(setting, logs[0].sampling_interval)
    paths = {e: sparse(*data[e], own[e], gain * before.noise[e], setting) for e in robot.velocities}
    tried: dict[tuple[bytes, ...], tuple[int, HeldOut, dict[str, np.ndarray]]] = {}

    def judge(kept: dict[str, np.ndarray]) -> tuple[int, HeldOut, dict[str, np.ndarray]]:
        key = tuple(mask.tobytes() for mask in kept.values())
        if key not in tried:
            count = int(sum(mask.sum() for mask in kept.values()))
            # Once something is added anywhere, the model's own constants may move in all equations.
            coefficients = {e: weights(*data[e], kept[e], own[e], setting) for e in robot.velocities}
            after = held_out_state(with_coefficients(base, coefficients), held_out, before.noise) if count else before
            tried[key] = (count, after, coefficients)
        return tried[key]

    def sparsest(options: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
        limit = (1 + setting.tolerance) * min(judge(option)[1].normalised_rms for option in options)
        return min((o for o in options if judge(o)[1].normalised_rms <= limit), key=lambda o: judge(o)[0])

    nothing = np.zeros(len(names), bool)
    joint = [{e: path[k] for e, path in paths.items()} for k in range(len(setting.thresholds))]
    kept = sparsest([dict.fromkeys(robot.velocities, nothing), *joint])
    for equation in robot.velocities * setting.sweeps:
        kept = sparsest([kept | {equation: mask} for mask in (nothing, *paths[equation])])
    _, after, coefficients = judge(kept)
    labels = list(names)
    found = {
        (equation, labels[k]): float(coefficients[equation][k])
        for equation, mask in kept.items()
        for k in np.flatnonzero(mask)
    }
    return Answer(found, before, after)
