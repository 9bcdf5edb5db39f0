"""Keeping a process that explains one robot after another small.

Every model has programs of its own, a few megabytes each, which JAX keeps for as long as the process lives, and what the
allocator has got back it does not return to the system by itself.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import jax

MOST_PROGRAMS = 250
"""Compiled programs that are kept. Robots of one or two kinds with logs of one length make fewer, and compile nothing twice."""


def programs() -> int:
    """Compiled programs in the memory of this process."""
    return sum(len(client.live_executables()) for client in {device.client for device in jax.local_devices()})


_made = 0
"""Programs that jaxid's explanations have left since they were last forgotten."""


@contextmanager
def bounded_memory() -> Iterator[None]:
    """At the end of the block, or of a function (`@bounded_memory()`): where such blocks have left more than `MOST_PROGRAMS`,
    JAX forgets all of them, the user's with them; what is needed again is compiled again, or read from the compilation
    cache. However many programs the user has, they are not counted."""
    global _made
    before = programs()
    try:
        yield
    finally:
        _made += max(programs() - before, 0)
        if _made > MOST_PROGRAMS:
            _made = 0
            jax.clear_caches()
            with suppress(OSError, AttributeError):  # another C library than glibc
                ctypes.CDLL(None).malloc_trim(0)
