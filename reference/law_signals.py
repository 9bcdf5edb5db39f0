"""Laws on signals: what a command map makes of the inputs, when inputs are felt and speeds were seen, what sensors say.

Delays are shares: a signal arrives as sum_j w_j signal(t - d_j), with its own (d_j, w_j) for each channel, so that a
delay is one share, a moving average many equal ones, and a drawn step response a few unequal ones.
"""

from collections.abc import Mapping

import numpy as np

from reference import curves

Full = Mapping[str, Mapping[str, float]]
AVERAGED = 12  # places of a moving average
STEPS = 4  # of a drawn step response


def _odd(u: np.ndarray, size: np.ndarray) -> np.ndarray:
    return np.sign(u) * size


def _only(u: np.ndarray, changed: np.ndarray, values: Mapping[str, float], name: str) -> np.ndarray:
    """`u` with the column that `values[name]` counts changed; with all where there is no such name."""
    if name not in values:
        return changed
    column = int(values[name]) - 1
    if not 0 <= column < u.shape[1]:
        raise ValueError(f"There is no {name} {column + 1}; there are {u.shape[1]}.")
    out = u.copy()
    out[:, column] = changed[:, column]
    return out


def _dead_zone(u: np.ndarray, word: str, v: Mapping[str, float]) -> np.ndarray:
    size = np.abs(u)
    if word == "threshold":
        return np.where(size > v["threshold"], u, 0.0)
    if word == "drawn":
        full = 3.0 * v["threshold"]
        return _odd(u, np.where(size < full, full * curves.evaluate(curves.convex(v["seed"]), size / full), size))
    edge = v["threshold"] * np.where(u < 0, v.get("ratio", 1.0), 1.0)
    return _only(u, _odd(u, np.maximum(size - edge, 0.0)), v, "motor")


def _saturation(u: np.ndarray, word: str, v: Mapping[str, float]) -> np.ndarray:
    inverse = v["inverse_limit"]
    if word == "tanh":
        return np.tanh(u * inverse) / inverse
    if word == "drawn":
        full = 2.5 / inverse
        return _odd(u, full * curves.evaluate(curves.compressing(v["seed"]), np.abs(u) / full))
    return np.minimum(u, 1.0 / inverse)


def _play(u: np.ndarray, half: float) -> np.ndarray:
    """The play operator, from rest: follows its input at a distance of at most `half`."""
    out = np.empty_like(u)
    last = np.zeros(u.shape[1])
    for k, row in enumerate(u):
        last = out[k] = np.clip(last, row - half, row + half)
    return out


def commanded(inputs: np.ndarray, full: Full) -> np.ndarray:
    """What the command map makes of the inputs (N, m)."""
    u = np.array(inputs, float)
    for law, v in full.items():
        mechanism, word = law.split("/")
        if mechanism == "actuator_dead_zone":
            u = _dead_zone(u, word, v)
        elif mechanism == "voltage_saturation":
            u = _saturation(u, word, v)
        elif mechanism == "backlash":
            u = _play(u, 0.5 * v["width"])
        elif law == "motor_gain_mismatch/drawn":
            gain = 1.0 + v["mismatch"] * 2.0 * curves.evaluate(curves.growing(v["seed"]), np.abs(u) / v["full"])
            u = _only(u, u * gain, v, "motor")
        elif mechanism == "motor_cross_talk":
            u = _leaking(u, word, v)
    return u


def _leaking(u: np.ndarray, word: str, v: Mapping[str, float]) -> np.ndarray:
    if word == "one_way":
        return _only(u, u + v["share"] * u[:, [int(v["other"]) - 1]], v, "motor")
    passing = u
    if word == "drawn":
        passing = u * 2.0 * curves.evaluate(curves.growing(v["seed"]), np.abs(u) / v["full"])
    return u + v["share"] * (passing.sum(1, keepdims=True) - passing) / (u.shape[1] - 1)


def _staircase(mean: float, seed: float) -> tuple[np.ndarray, np.ndarray]:
    """Delays and weights of a drawn step response with this mean delay."""
    rng = np.random.default_rng([int(seed), 78])
    weights = rng.uniform(0.2, 1.0, STEPS)
    weights /= weights.sum()
    delays = np.append(0.0, np.cumsum(rng.uniform(0.3, 1.0, STEPS - 1)))
    return delays * mean / (delays @ weights), weights


def _shares(full: Full, n: int, channels: int, single: str, which: str, others: tuple[str, ...]) -> list:
    """Shares [(delays (n, channels), weight)] by which a signal arrives; none where no law delays it.

    `single` is the mechanism of pure delays, `which` the name of the number of the one channel it may be for.
    """
    for law, v in full.items():
        mechanism, word = law.split("/")
        if mechanism == single and word == "jittering":
            each = np.random.default_rng([int(v["seed"]), 79]).uniform(0.0, 2.0 * v["delay"], (n, 1))
            return [(np.repeat(each, channels, 1), 1.0)]
        if mechanism == single and word == "growing":
            return [(np.repeat(np.linspace(0.0, 2.0 * v["delay"], n)[:, None], channels, 1), 1.0)]
        if mechanism == single:
            return [(_only(np.zeros((n, channels)), np.full((n, channels), v["delay"]), v, which), 1.0)]
        if law in others and word == "moving_average":
            places = (np.arange(AVERAGED) + 0.5) / AVERAGED * 2.0 * v["time_constant"]
            return [(np.full((n, channels), place), 1.0 / AVERAGED) for place in places]
        if law in others:
            delays, weights = _staircase(v["time_constant"], v["seed"])
            return [(np.full((n, channels), d), w) for d, w in zip(delays, weights, strict=True)]
    return []


def input_shares(full: Full, n: int, motors: int) -> list:
    """Shares of n rows of inputs, see `_shares`."""
    return _shares(full, n, motors, "input_delay", "motor", ("motor_lag/drawn",))


def sensor_shares(full: Full, n: int, channels: int) -> list:
    """Shares of n samples of speeds, see `_shares`."""
    return _shares(full, n, channels, "sensor_delay", "channel", ("sensor_lag/moving_average", "sensor_lag/drawn"))


def sensed(speeds: np.ndarray, time: np.ndarray, full: Full) -> np.ndarray:
    """What the sensors say of the speeds (N, n_v)."""
    out = np.array(speeds, float)
    share = time / time[-1] if time[-1] > 0 else time
    for law, v in full.items():
        mechanism, word = law.split("/")
        if mechanism == "sensor_bias":
            course = {
                "drifting": lambda v: share,
                "warming": lambda v: 1.0 - np.exp(-time / v["time"]),
                "drawn": lambda v: curves.evaluate(curves.periodic(v["seed"]), share),
            }[word](v)
            out = _only(out, out + v["bias"] * course[:, None], v, "channel")
        elif mechanism == "sensor_scale":
            error = v["error"] * (speeds > 0)
            if word == "drawn":
                error = v["error"] * curves.evaluate(curves.growing(v["seed"]), np.minimum(np.abs(speeds), 1.0))
            out = _only(out, out * (1.0 + error), v, "channel")
        elif law == "sensor_cross_talk/rotated":
            cos, sin = np.cos(v["angle"]), np.sin(v["angle"])
            out[:, :2] = out[:, :2] @ np.array([[cos, -sin], [sin, cos]])
        elif law == "sensor_cross_talk/drawn":
            size = np.minimum(np.abs(speeds[:, [int(v["other"]) - 1]]), 1.0)
            out = _only(out, out + v["error"] * curves.evaluate(curves.growing(v["seed"]), size), v, "channel")
        elif mechanism == "sensor_cross_talk":
            out = _only(out, out + v["angle"] * speeds[:, [int(v["other"]) - 1]], v, "channel")
    return out
