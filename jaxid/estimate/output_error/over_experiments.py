"""A function of every experiment: as lanes of one device, or, on a mesh of several, each device for its own experiments."""

from collections.abc import Callable
from typing import Any

import jax
from jax.sharding import PartitionSpec

AXIS = "experiments"
"""Name of a mesh's axis along which experiments lie."""


def over_experiments(one: Callable[..., Any], *each: Any) -> Any:
    """`jax.vmap(one)(*each)`; where a mesh with the axis `AXIS` is set, every device maps over the experiments it holds.

    What `one` closes over is every device's. The compiler cannot divide a call of machine code by itself: it would give every
    device all experiments.
    """
    mesh = jax.sharding.get_abstract_mesh()
    if AXIS not in mesh.axis_names:
        return jax.vmap(one)(*each)
    along = PartitionSpec(AXIS)
    return jax.shard_map(jax.vmap(one), mesh=mesh, in_specs=along, out_specs=along, check_vma=False)(*each)
