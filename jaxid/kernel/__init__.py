"""Rollouts as machine code: a robot's own JAX functions, traced once, become a loop over lanes that LLVM vectorises."""
