"""Effects on whole records, before and after a rollout in machine code: on commands and on what sensors report.

They act on signals, not in the equations of motion, and are run by themselves: a robot with one has the machine code of the
robot without it. Effects on commands that remember none have machine code of their own (`command_map.py`). The others are run
in NumPy, so that nothing is compiled; what runs often on the same shape, and what NumPy has no operation for, such as a loop
over all samples, is a small program of XLA's.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .._compile import compiled
from ..kernel.in_numpy import in_numpy
from ..kernel.symbolic import Untranslated
from ..robots.effect import Effect
from ..robots.robot import Robot
from ..robots.signal_path import STAGES, overrides, passed
from .command_map import command_map
from .rollout import commanded as _commanded_one
from .rollout import parts_of_a_sample

Array = Any
"""NumPy's, or what can be read as such."""
_MOST_MODELS = 256
_SELDOM = 4_000_000
"""Numbers computed on one shape up to which NumPy, at up to ten times the time of XLA's program (some 0.3 µs a number), is done
before XLA has compiled (1 to 2 s)."""
_TRIED = 3
"""Samples of the record on which it is seen which parameters an effect reads."""


class Records(NamedTuple):
    """The effects on whole records of a robot with the parameters `names`: `robot` has no others and no numbers.

    `commands` and `measures`: places among the names of what effects on commands, and on sensors, read; None without such
    effects. `memoryless`: whether all that act on commands are.
    """

    robot: Robot
    names: tuple[str, ...]
    commands: tuple[int, ...] | None
    measures: tuple[int, ...] | None
    memoryless: bool

    def rows(self, substeps: int) -> int:
        """How often a sample's inputs are computed: once, or in every sub-step where effects remember earlier commands."""
        return 1 if self.commands is None or self.memoryless else substeps

    def parts(self, substeps: int) -> int:
        """How often outputs are needed in the time of a sample."""
        return parts_of_a_sample(self.robot, substeps)


class _Seen(Mapping[str, Any]):
    """Numbers that remember which of them were asked for."""

    def __init__(self, numbers: Mapping[str, Any]):
        self.numbers, self.asked = numbers, set[str]()

    def __getitem__(self, name: str) -> Any:
        self.asked.add(name)
        return self.numbers[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.numbers)

    def __len__(self) -> int:
        return len(self.numbers)


def on_records_alone(effect: Effect, robot: Robot) -> bool:
    """Whether the effect acts on commands or sensors and nowhere else."""
    inside = any(overrides(type(effect), stage) for stage in (*STAGES, "numbers", "rates"))
    return not inside and not effect.states_on(robot)


def without_records(robot: Robot) -> Robot:
    """The robot without effects that act on commands or sensors alone, where its states are the same without them."""
    kept = tuple(effect for effect in robot.effects if not on_records_alone(effect, robot))
    plain = replace(robot, effects=kept)
    return plain if plain.states == robot.states else robot


@lru_cache(_MOST_MODELS)
def records_of(robot: Robot, names: tuple[str, ...]) -> Records:
    """The effects on records of `robot`, a structure without numbers."""
    own = tuple(e for e in robot.effects if any(overrides(type(e), stage) for stage in ("command", "measure")))
    bare = replace(robot, effects=own)
    U, Y = len(robot.channels.inputs), len(robot.channels.measured)
    record = jax.ShapeDtypeStruct((_TRIED, U), float), jax.ShapeDtypeStruct((_TRIED, Y), float)
    numbers = [jax.ShapeDtypeStruct((), float)] * len(names)
    time = jax.ShapeDtypeStruct((_TRIED,), float)

    def read(stage: str, act: Callable[..., Any]) -> tuple[int, ...] | None:
        if not any(overrides(type(effect), stage) for effect in own):
            return None
        asked: set[str] = set()

        def tried(p, u, y, dt):
            seen = _Seen(dict(zip(names, p, strict=True)))
            result = act(seen, u, y, dt)
            asked.update(seen.asked)
            return result

        try:
            jax.eval_shape(tried, numbers, *record, time)
        except Exception:  # a user's own may ask for longer records, or do with its numbers what only a dictionary can
            return tuple(range(len(names)))
        return tuple(i for i, name in enumerate(names) if name in asked)

    commands = read("command", lambda p, u, y, dt: _commanded_one(bare, p, u, dt, 1))
    measures = read("measure", lambda p, u, y, dt: _measured_one(bare, p, y, dt))
    memoryless = all(effect.memoryless for effect in own if overrides(type(effect), "command"))
    return Records(bare, names, commands, measures, memoryless)


def _measured_one(
    robot: Robot, p: Mapping[str, Any], y: Float[Array, "n Y"], dt: Float[Array, " T"], held: Any = 0.0, parts: int = 1
):
    dt = jnp.repeat(dt / parts, parts) if parts > 1 else dt
    time = jnp.concatenate([jnp.zeros(1), jnp.cumsum(dt)[:-1]])
    return passed(robot, "measure", y, time, p, moving=held)[::parts]


def _commanded_all(robot: Robot, names: tuple[str, ...], substeps: int, q, inputs, dt, held):
    numbers = dict(zip(names, q, strict=True))
    return jax.vmap(lambda u, d, h: _commanded_one(robot, numbers, u, d, substeps, h))(inputs, dt, held)


def _command(robot: Robot, names: tuple[str, ...], substeps: int, q, inputs, dt, held):
    return _commanded_all(robot, names, substeps, q, inputs, dt, held)


def _command_slopes(robot: Robot, names: tuple[str, ...], substeps: int, q, inputs, dt, held, dq):
    def moved(step):
        return jax.jvp(lambda q: _commanded_all(robot, names, substeps, q, inputs, dt, held), (q,), (step,))[1]

    return jax.vmap(moved)(dq)


def _measured_all(robot: Robot, names: tuple[str, ...], parts: int, q, y, dt, held):
    numbers = dict(zip(names, q, strict=True))
    return jax.vmap(lambda own, d, h: _measured_one(robot, numbers, own, d, h, parts))(y, dt, held)


def _measure(robot: Robot, names: tuple[str, ...], parts: int, q, y, dt, held):
    return _measured_all(robot, names, parts, q, y, dt, held)


def _measure_slopes(robot: Robot, names: tuple[str, ...], parts: int, q, y, dt, held, dq, dy):
    def moved(step, change):
        return jax.jvp(lambda q, y: _measured_all(robot, names, parts, q, y, dt, held), (q, y), (step, change))[1]

    return jax.vmap(moved, in_axes=(0, -1), out_axes=-1)(dq, dy)


_in_xla = {
    function: compiled(function, static_argnums=tuple(range(fixed)))
    for function, fixed in ((_command, 3), (_command_slopes, 3), (_measure, 3), (_measure_slopes, 3))
}


class _Runs:
    """A function of arrays of given shapes, and how much it has computed: what computes much is worth compiling."""

    def __init__(self, function: Callable[..., Any], fixed: tuple[Any, ...], shapes: tuple[tuple[int, ...], ...]):
        self.function, self.fixed, self.left = function, fixed, _SELDOM
        try:
            arrays = (jax.ShapeDtypeStruct(shape, float) for shape in shapes)
            self.steps = in_numpy(partial(function, *fixed), *arrays)
        except Untranslated:
            self.left = 0

    def __call__(self, *arrays: np.ndarray) -> np.ndarray:
        if self.left <= 0:
            return np.asarray(_in_xla[self.function](*self.fixed, *arrays))
        (found,) = self.steps(*arrays)
        self.left -= found.size
        return found


_runs = lru_cache(_MOST_MODELS)(_Runs)


def _run(function: Callable[..., Any], fixed: tuple[Any, ...], *records: Any) -> np.ndarray:
    """`function` of what is `fixed` and of arrays."""
    arrays = [np.asarray(record, float) for record in records]
    return _runs(function, fixed, tuple(array.shape for array in arrays))(*arrays)


def _names(records: Records, places: tuple[int, ...]) -> tuple[str, ...]:
    return tuple(records.names[i] for i in places)


def in_motion(robot: Robot, begin: Float[Array, "*c E S"]) -> Float[np.ndarray, " E"]:
    """Whether each log begins in motion, by the robot's states in which it does, of which any set says so."""
    moving = [robot.states.index(name) for name in robot.velocities if name in robot.states]
    there = np.any(np.asarray(begin)[..., moving] != 0.0, axis=-1)
    return np.asarray(np.any(there, axis=tuple(range(there.ndim - 1))), float)


def commanded(
    records: Records,
    p: Float[Array, " P"],
    inputs: Float[Array, "E T U"],
    dt: Float[Array, "E T"],
    substeps: int,
    held: Float[Array, " E"],
) -> Float[np.ndarray, "E T R U"]:
    """What arrives of the inputs: one row a sample, or, with effects that remember earlier commands, one a sub-step. `held` (0
    or 1) as `robots.signal_path.sent` has it."""
    if records.commands is None:
        return np.asarray(inputs)[:, :, None, :]
    own, names = np.asarray(p, float)[list(records.commands)], _names(records, records.commands)
    if records.memoryless and (code := command_map(records.robot, names)) is not None:
        return code.values(own, np.asarray(inputs, float))[:, :, None, :]
    return _run(_command, (records.robot, names, records.rows(substeps)), own, inputs, dt, held)


def commanded_each(
    records: Records,
    p: Float[Array, "c P"],
    inputs: Float[Array, "E T U"],
    dt: Float[Array, "E T"],
    substeps: int,
    held: Float[Array, " E"],
) -> Float[np.ndarray, "c E T R U"]:
    """`commanded` with each of c sets of parameters; computed once for those that no effect on commands tells apart."""
    if records.commands is None:
        return np.broadcast_to(
            np.asarray(inputs)[:, :, None, :], (len(p), *np.shape(inputs)[:2], 1, np.shape(inputs)[2])
        )
    _, first, same = np.unique(p[:, records.commands], axis=0, return_index=True, return_inverse=True)
    return np.stack([commanded(records, p[k], inputs, dt, substeps, held) for k in first])[same.reshape(-1)]


def command_slopes(
    records: Records,
    p: Float[Array, " P"],
    inputs: Float[Array, "E T U"],
    dt: Float[Array, "E T"],
    substeps: int,
    held: Float[Array, " E"],
    dp: Float[Array, "k P"],
) -> Float[np.ndarray, "k E T R U"]:
    """Its derivatives in k directions of the parameters; with effects on commands only."""
    assert records.commands is not None
    places = list(records.commands)
    own, step = np.asarray(p, float)[places], np.asarray(dp, float)[:, places]
    names = _names(records, records.commands)
    if records.memoryless and (code := command_map(records.robot, names)) is not None:
        return code.slopes(own, np.asarray(inputs, float), step)[:, :, :, None, :]
    return _run(_command_slopes, (records.robot, names, records.rows(substeps)), own, inputs, dt, held, step)


def measured(
    records: Records,
    p: Float[Array, " P"],
    y: Float[Array, "E n Y"],
    dt: Float[Array, "E T"],
    held: Float[Array, " E"],
) -> Float[np.ndarray, "E T Y"]:
    """What the sensors report of the outputs `y`, one or several a sample (`parts`); `held` (0 or 1): whether each log begins
    in motion."""
    if records.measures is None:
        return np.asarray(y)
    own = np.asarray(p, float)[list(records.measures)]
    return _run(_measure, _measure_of(records, y, dt), own, y, dt, held)


def _measure_of(records: Records, y: Float[Array, "E n Y"], dt: Float[Array, "E T"]):
    assert records.measures is not None
    return records.robot, _names(records, records.measures), np.shape(y)[1] // np.shape(dt)[1]


def measured_each(
    records: Records,
    p: Float[Array, "c P"],
    y: Float[Array, "c E n Y"],
    dt: Float[Array, "E T"],
    held: Float[Array, " E"],
) -> Float[np.ndarray, "c E T Y"]:
    """`measured` with each of c sets of parameters."""
    if records.measures is None:
        return y
    return np.stack([measured(records, *own, dt, held) for own in zip(p, y, strict=True)])


def measured_slopes(
    records: Records,
    p: Float[Array, " P"],
    y: Float[Array, "E n Y"],
    dt: Float[Array, "E T"],
    held: Float[Array, " E"],
    dp: Float[Array, "K P"],
    dy: Float[Array, "E n Y K"],
) -> Float[np.ndarray, "E T Y K"]:
    """Tangents of what the sensors report, from those of the parameters and of the outputs."""
    if records.measures is None:
        return np.asarray(dy)
    places = list(records.measures)
    own, step = np.asarray(p, float)[places], np.asarray(dp, float)[:, places]
    return _run(_measure_slopes, _measure_of(records, y, dt), own, y, dt, held, step, dy)
