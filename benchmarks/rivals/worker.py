"""One rival in a process of its own: `python -m benchmarks.rivals.worker NAME`.

Reads one JSON request a line ({"problem": file} or {"problem": file, "path": true}), answers with one JSON line. One
processor core, one thread, no persistent compilation cache.
"""

import importlib
import importlib.util
import json
import os
import shutil
import sys
import time
from pathlib import Path

RIVALS = {
    "jaxid": ("jaxid_fit", "core"),
    "jaxid.output_error, initial states estimated": ("jaxid_fit", "public_estimate"),
    "jaxid.output_error, known start": ("jaxid_fit", "public_known"),
    "SciPy trf, dense differences, numba": ("scipy_fit", "dense"),
    "SciPy trf, structured differences, numba": ("scipy_fit", "structured"),
    "optimistix as it comes": ("optimistix_fit", "plain"),
    "optimistix on jaxid's rollouts": ("optimistix_fit", "on_machine_code"),
    "diffrax + optimistix as documented": ("diffrax_fit", "documented"),
    "CasADi generated C, SciPy lm": ("casadi_fit", "lm"),
    "CasADi generated C, SciPy trf": ("casadi_fit", "trf"),
    "CasADi, IPOPT multiple shooting": ("casadi_fit", "multiple_shooting"),
    "C++, scalar": ("cpp_fit", "scalar"),
    "C++, eight lanes": ("cpp_fit", "simd"),
}
NEEDS = {"diffrax_fit": "diffrax", "casadi_fit": "casadi", "optimistix_fit": "optimistix", "scipy_fit": "numba"}
COMPILERS = {"casadi_fit": "gcc", "cpp_fit": "g++"}
ENVIRONMENT = {
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "JAX_ENABLE_COMPILATION_CACHE": "false",
    "JAX_PLATFORMS": "cpu",
}


def absent(name: str) -> str | None:
    """Why a rival is left out here, or None."""
    module = RIVALS[name][0]
    package, compiler = NEEDS.get(module), COMPILERS.get(module)
    if package and importlib.util.find_spec(package) is None:
        return f"{package} is not installed: pip install -e '.[rivals]'"
    if compiler and shutil.which(compiler) is None:
        return f"no {compiler} on this machine"
    return None


def _processor() -> float:
    """Processor seconds of this process and of the compilers that it called."""
    spent = os.times()
    return time.process_time() + spent.children_user + spent.children_system


def main() -> None:
    """Serve fits until the input ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever a library prints is not an answer
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    wall, processor = time.perf_counter(), _processor()
    module_name, function = RIVALS[sys.argv[1]]
    module = importlib.import_module(f"benchmarks.rivals.{module_name}")
    from benchmarks.rivals.pioneer_problem import FitProblem

    imported = {"seconds": time.perf_counter() - wall, "processor_seconds": _processor() - processor}
    for line in sys.stdin:
        request = json.loads(line)
        problem = FitProblem.load(Path(request["problem"]))
        if "path" in request:
            answer = {"path": module.path(problem)}
        else:
            wall, processor = time.perf_counter(), _processor()
            reached = getattr(module, function)(problem)
            answer = {
                "seconds": time.perf_counter() - wall,
                "processor_seconds": _processor() - processor,
                "linearisations": reached.linearisations,
                "reason": reached.reason,
                "path": reached.path,
                "x": [float(v) for v in reached.x],
                "import": imported,
            }
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
