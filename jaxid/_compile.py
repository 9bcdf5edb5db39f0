"""`jax.jit` for jaxid's large programs: XLA's older CPU fusion code, which compiles them in about 60 % of the time and to
programs that run equally fast (`benchmarks/fit.py` prints both times). Other devices take no notice."""

from functools import partial

import jax

compiled = partial(jax.jit, compiler_options={"xla_cpu_use_fusion_emitters": False})
