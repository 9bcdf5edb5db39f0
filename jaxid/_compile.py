"""`jax.jit` for jaxid's large programs: with XLA's older CPU fusion code, which compiles them markedly sooner and to
programs that run equally fast. Other devices take no notice."""

from functools import partial

import jax

compiled = partial(jax.jit, compiler_options={"xla_cpu_use_fusion_emitters": False})
