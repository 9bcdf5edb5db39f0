"""Effects on whole records, before and after a rollout in machine code: on commands and on what sensors report.

They act on signals, not in the equations of motion, and are run by themselves: a robot with one has the machine code of the
robot without it. Effects on commands that remember none have machine code of their own (`command_map.py`). The others are run
in NumPy, so that nothing is compiled; what runs often on the same shape, and what NumPy has no operation for, such as a loop
over all samples, is a small program of XLA's.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import groupby
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from ..kernel.in_numpy_or_xla import in_numpy_or_xla
from ..robots.effect import Effect
from ..robots.robot import Robot
from ..robots.signal_path import STAGES, overrides, passed, sent
from .command_map import command_map
from .rollout import fine_clock, parts_of_a_sample, shares_of_a_step

Array = Any
"""NumPy's, or what can be read as such."""
Clock = tuple[Array, Array]
"""When each row of records begins and how long it lasts [E n]."""
_MOST_MODELS = 256
_TRIED = 3
"""Samples of the record on which it is seen which parameters an effect reads."""
_DIRECTIONS = 4
"""To multiples of this directions of derivatives are filled up, but for one or two, so that few numbers of them are traced."""


class Link(NamedTuple):
    """Effects that act on whole records one right after another: `robot` has no others and reads of all parameters those at
    `places`, which have the `names`. `memoryless`: whether they answer every command alone."""

    robot: Robot
    names: tuple[str, ...]
    places: tuple[int, ...]
    memoryless: bool = False


class Records(NamedTuple):
    """The effects on whole records of a robot with the parameters `names`: `robot` has no others and no numbers.

    `commands` and `measures`: places among the names of what effects on commands, and on sensors, read; None without such
    effects. `memoryless`: whether all that act on commands are. `sending` and `sensing`: the effects one by one, in the order
    in which they act, those on commands that are memoryless together.
    """

    robot: Robot
    names: tuple[str, ...]
    commands: tuple[int, ...] | None
    measures: tuple[int, ...] | None
    memoryless: bool
    sending: tuple[Link, ...]
    sensing: tuple[Link, ...]

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
    sending = [e for e in own if overrides(type(e), "command")]
    together = [tuple(some) for _, some in groupby(sending, lambda e: e.memoryless or e)]
    commands = tuple(_link(replace(robot, effects=some), names, "command", some[0].memoryless) for some in together)
    sensing = [e for e in own if overrides(type(e), "measure")]
    measures = tuple(_link(replace(robot, effects=(e,)), names, "measure", False) for e in sensing)
    memoryless = all(link.memoryless for link in commands)
    return Records(bare, names, _read(commands), _read(measures), memoryless, commands, measures)


def _read(links: tuple[Link, ...]) -> tuple[int, ...] | None:
    return tuple(sorted({place for link in links for place in link.places})) if links else None


@lru_cache(_MOST_MODELS)
def _link(bare: Robot, names: tuple[str, ...], stage: str, memoryless: bool) -> Link:
    """The effects of `bare` at one stage, with what they read of the parameters `names`."""
    U, Y = len(bare.channels.inputs), len(bare.channels.measured)
    numbers, row = [jax.ShapeDtypeStruct((), float)] * len(names), jax.ShapeDtypeStruct((_TRIED,), float)
    signal = jax.ShapeDtypeStruct((_TRIED, U if stage == "command" else Y), float)
    asked: set[str] = set()

    def tried(p, signal, time, dt):
        seen = _Seen(dict(zip(names, p, strict=True)))
        result = _act(bare, stage, seen, signal, time, dt, 0.0)
        asked.update(seen.asked)
        return result

    try:
        jax.eval_shape(tried, numbers, signal, row, row)
    except Exception:  # a user's own may ask for longer records, or do with its numbers what only a dictionary can
        asked.update(names)
    places = tuple(i for i, name in enumerate(names) if name in asked)
    return Link(bare, tuple(names[i] for i in places), places, memoryless)


def _act(robot: Robot, stage: str, p: Mapping[str, Any], signal, time, dt, held):
    """What the effects of `robot` at this stage make of a record."""
    if stage == "command":
        return sent(robot, signal, time, dt, p, held)
    return passed(robot, stage, signal, time, p, moving=held)


def _acted(robot: Robot, names: tuple[str, ...], stage: str, q, signals, time, dt, held):
    numbers = dict(zip(names, q, strict=True))
    return jax.vmap(lambda *record: _act(robot, stage, numbers, *record))(signals, time, dt, held)


def _values(robot: Robot, names: tuple[str, ...], stage: str, q, signals, time, dt, held):
    """What the effects make of every record [E n S]."""
    return (_acted(robot, names, stage, q, signals, time, dt, held),)


def _slopes(robot: Robot, names: tuple[str, ...], stage: str, q, signals, time, dt, held, dq, *ds):
    """The same, and its tangents [E n S K] from those of the parameters [K P] and of the records [E n S K], which may be left
    out where these do not move."""

    def act(q, signals):
        return _acted(robot, names, stage, q, signals, time, dt, held)

    def moved(step, *change):
        if not change:
            return jax.jvp(lambda q: act(q, signals), (q,), (step,))
        return jax.jvp(act, (q, signals), (step, *change))

    return jax.vmap(moved, (0, *(-1 for _ in ds)), (None, -1))(dq, *ds)


def _run(function: Callable[..., Any], link: Link, stage: str, *records: Any) -> list[np.ndarray]:
    """`function` of arrays, by the effects of the link. Searches ask for what several effects make of the same records again
    and again: where only what follows has moved, and where a step that was tried is taken."""
    return in_numpy_or_xla(function, (link.robot, link.names, stage), [np.asarray(record, float) for record in records])


def _own(link: Link, p: Float[Array, "*k P"]) -> Float[np.ndarray, "*k p"]:
    return np.asarray(p, float)[..., list(link.places)]


def _along(links: tuple[Link, ...], stage: str, p, signals, clock: Clock, held) -> np.ndarray:
    """What all links make of records, one after another."""
    for link in links:
        code = command_map(link.robot, link.names) if link.memoryless else None
        if code is not None:
            signals = code.values(_own(link, p), signals)
        else:
            (signals,) = _run(_values, link, stage, _own(link, p), signals, *clock, held)
    return signals


def _slopes_along(links: tuple[Link, ...], stage: str, p, signals, clock: Clock, held, dp, ds=None) -> np.ndarray:
    """The tangents [E n S K] of what all links make of records, from those of the parameters, [K P], and of the records."""
    K = len(dp)
    more = _filled(K) - K  # in few numbers of directions, each of which is traced
    dp = np.concatenate([dp, np.zeros((more, dp.shape[1]))])
    if ds is not None:
        ds = np.concatenate([ds, np.zeros((*ds.shape[:-1], more))], axis=-1)
    for link in links:
        step = _own(link, dp)
        if ds is None and not step.any():
            signals = _along((link,), stage, p, signals, clock, held)
            continue
        code = command_map(link.robot, link.names) if link.memoryless else None
        if code is not None:
            signals, ds = code.values(_own(link, p), signals), code.slopes(_own(link, p), signals, step, ds)
        else:
            moving = () if ds is None else (ds,)
            signals, ds = _run(_slopes, link, stage, _own(link, p), signals, *clock, held, step, *moving)
    return np.zeros((*np.shape(signals), K)) if ds is None else ds[..., :K]


def _filled(K: int) -> int:
    return K if K in (1, 2) else _DIRECTIONS * -(-K // _DIRECTIONS)


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
    signals, clock, again = _finely(records, inputs, dt, substeps)
    return again(_along(records.sending, "command", p, signals, clock, held))


def _finely(records: Records, inputs: Float[Array, "E T U"], dt: Float[Array, "E T"], substeps: int):
    """The inputs [E n U] and the clock at the pace at which effects act on commands, and what makes rows of sub-steps
    [E T R ...] of something of that pace."""
    E, T, U = np.shape(inputs)
    rows = records.rows(substeps)
    parts = shares_of_a_step(rows)
    clock = fine_clock(np.asarray(dt, float), parts, np)
    signals = np.repeat(np.asarray(inputs, float), parts, axis=1)
    return signals, clock, lambda x: np.repeat(x.reshape(E, T, parts, *x.shape[2:]), rows // parts, axis=2)


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
    signals, clock, again = _finely(records, inputs, dt, substeps)
    return np.moveaxis(again(_slopes_along(records.sending, "command", p, signals, clock, held, dp)), -1, 0)


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
    parts = np.shape(y)[1] // np.shape(dt)[1]
    return _along(records.sensing, "measure", p, np.asarray(y), fine_clock(np.asarray(dt, float), parts, np), held)[
        :, ::parts
    ]


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
    parts = np.shape(y)[1] // np.shape(dt)[1]
    clock = fine_clock(np.asarray(dt, float), parts, np)
    return _slopes_along(records.sensing, "measure", p, np.asarray(y), clock, held, dp, np.asarray(dy))[:, ::parts]
