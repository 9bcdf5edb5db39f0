"""Good logs, as text: what the breakages start from and what a harmless one must read as."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jaxid import demo
from jaxid.logs import Channels, channels_of

DEMO = Path(demo.__file__).parent / "demo_logs"
PIONEER = ("fit_multilevel", "fit_prbs_forward", "fit_prbs_reversing", "fit_steps", "fit_turning", "check_arcs")
OMNI = ("fit_multilevel", "fit_prbs_reversing", "fit_steps", "fit_turning", "check_multilevel")
CURRENTS = ("i1", "i2", "i3", "i4")


@dataclass(frozen=True)
class Good:
    """One good log: `header` and `rows` are its cells as text."""

    robot: str
    name: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @property
    def channels(self) -> Channels:
        return channels_of(self.robot)

    @property
    def text(self) -> str:
        """The log as CSV."""
        return csv_text([self.header, *self.rows])

    @property
    def values(self) -> NDArray[np.float64]:
        """`[T, columns]`."""
        return np.array(self.rows, dtype=float)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Input columns of this file."""
        return tuple(name for name in self.header if name in self.channels.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Measured columns of this file."""
        return tuple(name for name in self.header if name in self.channels.measured)

    def column(self, name: str) -> NDArray[np.float64]:
        """One column, `[T]`."""
        return np.array([float(row[self.header.index(name)]) for row in self.rows])

    def short(self, samples: int) -> "Good":
        """The first rows only."""
        return replace(self, rows=self.rows[:samples])


def csv_text(lines: Iterable[Iterable[str]]) -> str:
    """Cells as comma-separated text."""
    return "\n".join(",".join(line) for line in lines) + "\n"


def _demo(robot: str, name: str, without: tuple[str, ...] = ()) -> Good:
    lines = [line.split(",") for line in (DEMO / robot / f"{name}.csv").read_text().splitlines()]
    kept = [k for k, column in enumerate(lines[0]) if column not in without]
    header, *rows = (tuple(line[k] for k in kept) for line in lines)
    without_any = ", no currents" if without else ""
    return Good(robot, f"{robot} {name}{without_any}", header, tuple(rows))


def _axis(seed: int, samples: int = 600) -> Good:
    """A drive axis with dry friction that always moves forwards, exact for each held force; speed and position."""
    rng = np.random.default_rng(seed)
    dt, mass, viscous, dry = 0.02, 2.0, 3.0, 0.4
    force = np.repeat(rng.uniform(1.0, 8.0, samples // 20), 20)
    speed, position = np.zeros(samples), np.zeros(samples)
    decay = np.exp(-viscous / mass * dt)
    for k in range(samples - 1):
        final = (force[k] - dry) / viscous
        speed[k + 1] = final + (speed[k] - final) * decay
        position[k + 1] = position[k] + final * dt + (speed[k] - final) * mass / viscous * (1 - decay)
    speed += rng.normal(0.0, 0.01, samples)
    position += rng.normal(0.0, 0.001, samples)
    table = zip(dt * np.arange(samples), force, speed, position, strict=True)
    rows = tuple((f"{t:.2f}", f"{u:.3f}", f"{v:.4f}", f"{q:.5f}") for t, u, v, q in table)
    return Good("axis", f"axis {seed}", ("t", "u", "v", "q"), rows)


@cache
def good_logs() -> tuple[Good, ...]:
    """Logs of the three robots in which pre-flight finds nothing (the omni's with and without its currents)."""
    omni = [_demo("omni", name, CURRENTS) for name in OMNI]
    with_currents = [_demo("omni", name) for name in ("fit_steps", "fit_turning")]
    return (*(_demo("pioneer", name) for name in PIONEER), *omni, *with_currents, *(_axis(seed) for seed in (1, 2, 3)))
