"""What effects without memory make of every command, and its slopes by their parameters, as machine code of one row.

Such an effect answers every command alone (a dead zone, a saturation, a drawn curve of the command), so that a record of any
length is the same few expressions over and over: nothing is traced or compiled again for another shape.
"""

from collections.abc import Sequence
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..kernel.expressions import Graph
from ..kernel.identity import identity_of
from ..kernel.map import Map, compiled_maps
from ..kernel.map_kernel import Mapped
from ..kernel.symbolic import Untranslated, inputs, run, scalars
from ..kernel.tangents import forward
from ..robots.robot import Robot
from ..robots.signal_path import sent

_MOST_MODELS = 256
Array = np.ndarray


class CommandMap:
    """The effects on commands of `robot`, all of them without memory, with the parameters `names`."""

    def __init__(self, robot: Robot, names: tuple[str, ...]):
        self.inputs, self.parameters = len(robot.channels.inputs), len(names)

        def arriving(p: Sequence[jax.Array], u: Sequence[jax.Array]):
            row = sent(robot, jnp.stack(u)[None], jnp.zeros(1), jnp.ones(1), dict(zip(names, p, strict=True)), 0.0)
            return tuple(row[0, i] for i in range(self.inputs))

        def make() -> list[Mapped]:
            graph, zero = Graph(), jnp.zeros(())
            p, u = (inputs(graph, group, n) for group, n in (("p", self.parameters), ("row", self.inputs)))
            jaxpr = jax.make_jaxpr(arriving)((zero,) * self.parameters, (zero,) * self.inputs)
            found = scalars(run(graph, jaxpr, [*p, *u]))
            one = graph.constant(1.0)
            slopes = [node for seed in scalars([*p, *u]) for node in forward(graph, found, {seed: one})]
            return [Mapped(graph, self.inputs, found), Mapped(graph, self.inputs, slopes)]

        values, slopes = compiled_maps(identity_of(robot, names), "commands", make)
        self._values: Map = values
        self._slopes: Map = slopes

    def values(self, p: Float[Array, " P"], inputs: Float[Array, "E T U"]) -> Float[Array, "E T U"]:
        """What arrives of the inputs."""
        return self._values(p, inputs, np.zeros((len(inputs), 0)))

    def slopes(
        self,
        p: Float[Array, " P"],
        inputs: Float[Array, "E T U"],
        dp: Float[Array, "k P"],
        du: Float[Array, "E T U k"] | None = None,
    ) -> Float[Array, "E T U k"]:
        """Its derivatives in k directions of the parameters and, where they move, of the inputs."""
        found = self._slopes(p, inputs, np.zeros((len(inputs), 0)))
        found = found.reshape(*found.shape[:2], self.parameters + self.inputs, self.inputs)
        by_p, by_u = np.split(found, [self.parameters], axis=2)
        slopes = np.einsum("kp,etpu->etuk", dp, by_p, optimize=True)
        return slopes if du is None else slopes + np.einsum("etvk,etvu->etuk", du, by_u, optimize=True)


@lru_cache(_MOST_MODELS)
def command_map(robot: Robot, names: tuple[str, ...]) -> CommandMap | None:
    """The map of a robot's structure with effects on commands alone, all without memory; None where it has no machine code."""
    try:
        return CommandMap(robot, names)
    except Untranslated:
        return None
