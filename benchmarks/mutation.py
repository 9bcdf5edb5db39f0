"""Deliberate faults, one at a time, in a copy of the checkout: do the tests that stand nearby notice?

    python -m benchmarks.mutation            apply each fault, run its tests, report those that survive (exit status 1)
    python -m benchmarks.mutation --match    only look whether every fault still matches the code exactly once (seconds)
    python -m benchmarks.mutation 3 7        those faults only

Compiled programs are kept between faults where JAX_COMPILATION_CACHE_DIR says so.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Fault:
    """A replacement that must match exactly once, and the tests that should fail with it."""

    what: str
    file: str
    old: str
    new: str
    tests: str


EQUATIONS, PIONEER = "jaxid/papers/pioneer/equations.py", "jaxid/robots/pioneer.py"
FAULTS = (
    Fault(
        "a sign in S(q)",
        EQUATIONS,
        '(-s / p["d"], -(p["d"] + p["l1"] * c) / p["d"])',
        '(-s / p["d"], (p["d"] + p["l1"] * c) / p["d"])',
        "tests/papers/pioneer/test_equations.py",
    ),
    Fault(
        "a part of the Coriolis matrix transposed",
        EQUATIONS,
        'jnp.einsum("jki,k->ij", slope, qdot)',
        'jnp.einsum("jki,k->ji", slope, qdot)',
        "tests/papers/pioneer/test_equations.py",
    ),
    Fault(
        "the gear counted once in the back-EMF and not in the motor",
        PIONEER,
        'emf = p["KE"] * p["tr"]',
        'emf = p["KE"]',
        "tests/robots/test_pioneer.py",
    ),
    Fault(
        "the gear's efficiency forgotten",
        PIONEER,
        'p["tr"] * p["mu"] * p["KT"] * i',
        'p["tr"] * p["KT"] * i',
        "tests/robots/test_pioneer.py",
    ),
    Fault(
        "swapped sides of the omni",
        "jaxid/robots/omni.py",
        "return Vn + spin, -V + spin, -Vn + spin, V + spin",
        "return Vn + spin, V + spin, -Vn + spin, -V + spin",
        "tests/robots/test_omni.py",
    ),
    Fault(
        "a sign of the turning frame",
        "jaxid/robots/omni.py",
        "Q[1] - c * M * W * V",
        "Q[1] + c * M * W * V",
        "tests/robots/test_omni.py",
    ),
    Fault(
        "the axis's offset pushes instead of resisting",
        "jaxid/robots/axis.py",
        'return (-p["offset"],)',
        'return (p["offset"],)',
        "tests/robots/test_axis.py",
    ),
    Fault(
        "a delay off by one sample",
        "jaxid/effects/actuator.py",
        'side="left") - 1, 0,',
        'side="left"), 0,',
        "tests/effects/test_irregular_stamps.py",
    ),
    Fault(
        "the dropped mask of the cost",
        "jaxid/estimate/output_error/problem.py",
        "residual = jnp.where(problem.mask, (y - problem.outputs) / problem.sigma, 0.0)",
        "residual = jnp.nan_to_num((y - problem.outputs) / problem.sigma)",
        "tests/estimate/output_error/test_problem.py",
    ),
    Fault(
        "the dropped mask of the sensitivities",
        "jaxid/estimate/output_error/problem.py",
        "jnp.where(mask[..., None], tangents * weight[..., None] * columns, 0.0)",
        "tangents / problem.sigma[..., None] * columns",
        "tests/estimate/output_error/test_problem.py",
    ),
    Fault(
        "degrees of freedom not accounted for",
        "jaxid/estimate/output_error/from_optimum.py",
        "counts * (1.0 - unknown_count / jnp.maximum(jnp.sum(counts), 1))",
        "counts * 1.0",
        "tests/estimate/output_error/test_channel_noise.py",
    ),
    Fault(
        "the noise of third differences with another gain",
        "jaxid/logs/noise.py",
        "/ np.sqrt(np.sum(shares**2, axis=0))",
        "/ np.sqrt(np.max(shares**2, axis=0))",
        "tests/logs/test_noise.py",
    ),
    Fault(
        "a wiring whose sign nobody looks at",
        "jaxid/checks/signs.py",
        "shares = np.sign(product) * product**2",
        "shares = product**2",
        "tests/checks/test_preflight.py -k wrong_sign_is_named",
    ),
    Fault(
        "a position that has to be zero at rest",
        "jaxid/checks/sensors.py",
        "values = speed(log, name)\n        there",
        "values = log.output(name)\n        there",
        "tests/checks/test_preflight.py -k rests_anywhere",
    ),
    Fault(
        "input held one sample late in the windows",
        "jaxid/checks/windows.py",
        "np.cumsum(rates[:-1] * steps, axis=0)",
        "np.cumsum(rates[1:] * steps, axis=0)",
        "tests/checks/test_windows.py",
    ),
)


def matches(fault: Fault, root: Path = ROOT) -> int:
    """How often the fault's text stands in its file."""
    path = root / fault.file
    return path.read_text(encoding="utf-8").count(fault.old) if path.exists() else 0


def noticed(fault: Fault, copy: Path) -> bool:
    """Whether the fault's tests fail with it."""
    path = copy / fault.file
    good = path.read_text(encoding="utf-8")
    path.write_text(good.replace(fault.old, fault.new), encoding="utf-8")
    try:
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *fault.tests.split()]
        run = subprocess.run(command, cwd=copy, capture_output=True, text=True, env=_environment(copy))
    finally:
        path.write_text(good, encoding="utf-8")
    if run.returncode not in (0, 1):
        raise RuntimeError(f"{fault.tests} did not run:\n{run.stdout}{run.stderr}")
    return run.returncode == 1


def _environment(copy: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(copy)}


def main(arguments: list[str]) -> int:
    """Exit status: 0 if every fault was noticed (or, with --match, matches exactly once)."""
    wrong = [fault for fault in FAULTS if matches(fault) != 1]
    for fault in wrong:
        print(f"{fault.what}: its text stands {matches(fault)} times in {fault.file}; write the fault anew")
    if wrong or "--match" in arguments:
        return 1 if wrong else 0
    chosen = [FAULTS[int(number) - 1] for number in arguments] or list(FAULTS)
    survived = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        kept = shutil.ignore_patterns(".git", ".venv", ".pytest_cache", "__pycache__")
        shutil.copytree(ROOT, copy, ignore=kept)
        for fault in chosen:
            began = time.perf_counter()
            found = noticed(fault, copy)
            survived += not found
            print(
                f"{'noticed ' if found else 'SURVIVED'}  {time.perf_counter() - began:5.0f} s  {fault.what}", flush=True
            )
    print(f"{len(chosen) - survived} of {len(chosen)} faults noticed")
    return 1 if survived else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
