"""`jax.jit` for jaxid's own programs.

On machines with few cores XLA's worker threads can starve one another inside a single large program, which then never
returns (seen with jaxlib 0.10 on two cores). So these programs run each operation on one thread; nobody else's do.
"""

from functools import partial

import jax

OPTIONS = {"xla_cpu_multi_thread_eigen": False}
compiled = partial(jax.jit, compiler_options=OPTIONS)
"""`jax.jit` with these options. Only for functions that are not called inside another jitted one."""
