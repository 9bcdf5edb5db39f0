"""Scalar and eight-lane C++ (`benchmarks/rivals/cpp`) from Python: compiled here with g++, called through ctypes.

The same integrator as jaxid's, derivatives by dual numbers, normal blocks, and a Levenberg-Marquardt with SciPy's stopping
rule, all in C++. "scalar" takes one experiment after another, "simd" eight side by side in the compiler's vector types.
"""

import ctypes
import shutil
import subprocess
import tempfile
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from .pioneer_problem import BETA_SPREAD, FREE, SAMPLING, SIGMA, STATE_SCALE, SUBSTEPS, FitProblem
from .reached import Reached

SOURCE = Path(__file__).parent / "cpp"
FLAGS = ("-std=c++17", "-O3", "-march=native", "-fPIC", "-shared", "-Wno-psabi")
PIONEER_FIXED = tuple("m1 R1 Ip1 d M m R xm ym Ip L l1 tr mu KT Ra KE tau_fr".split())
OMNI_FIXED = tuple("M b r l Kt Kv Ra supply".split())
_SIZES = {"pioneer": (7, 3), "omni": (7, 3), "pendulum": (3, 2)}
"""Free parameters and initial states."""


def absent() -> str | None:
    """Why these rows are left out, or None."""
    return None if shutil.which("g++") else "no g++ on this machine"


@cache
def library(kind: str) -> ctypes.CDLL:
    """The compiled rivals of `kind`, "scalar" or "simd". Raises `CalledProcessError` if they do not compile."""
    target = Path(tempfile.mkdtemp(prefix="jaxid_rivals_")) / f"{kind}.so"
    command = ["g++", *FLAGS, f"-D{kind.upper()}", "-o", str(target), str(SOURCE / "rivals.cpp")]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(target))


class _Task(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_long) for name in ("E", "T", "substeps")),
        *((name, ctypes.c_double) for name in ("interval", "state_scale")),
        *((name, ctypes.c_void_p) for name in ("inputs", "measured", "constants", "scale", "sigma", "prior")),
    ]


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


@dataclass
class CppTask:
    """One problem of one robot: `inputs` [E, T, nu], `measured` [E, T, ny], `constants` in the order of the C++ text,
    `scale` [n], `sigma` [ny], `prior` [s]: its weight on initial states in units of `state_scale`."""

    robot: str
    kind: str
    inputs: np.ndarray
    measured: np.ndarray
    constants: np.ndarray
    scale: np.ndarray
    sigma: np.ndarray
    prior: np.ndarray
    interval: float = SAMPLING
    substeps: int = SUBSTEPS
    state_scale: float = STATE_SCALE
    _task: _Task = field(init=False)

    def __post_init__(self) -> None:
        for name in ("inputs", "measured", "constants", "scale", "sigma", "prior"):
            setattr(self, name, np.ascontiguousarray(getattr(self, name), dtype=np.float64))
        E, T = self.inputs.shape[:2]
        arrays = (self.inputs, self.measured, self.constants, self.scale, self.sigma, self.prior)
        self._task = _Task(E, T, self.substeps, self.interval, self.state_scale, *(_pointer(a) for a in arrays))

    def _function(self, name: str, result: type):
        found = getattr(library(self.kind), f"{name}_{self.robot}_{self.kind}")
        found.restype = result
        return found

    def cost(self, x: np.ndarray) -> float:
        """The cost at the unknowns x [n + s E]."""
        x = np.ascontiguousarray(x, dtype=np.float64)
        return self._function("cost", ctypes.c_double)(ctypes.byref(self._task), _pointer(x))

    def linearise(self, x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Cost, normal blocks [E, N, N] and gradients [E, N] there, initial states before parameters."""
        E, N = len(self.inputs), sum(_SIZES[self.robot])
        x, blocks, gradients = np.ascontiguousarray(x, dtype=np.float64), np.empty((E, N, N)), np.empty((E, N))
        function = self._function("linearise", ctypes.c_double)
        cost = function(ctypes.byref(self._task), _pointer(x), _pointer(blocks), _pointer(gradients))
        return cost, blocks, gradients

    def fit(self, x: np.ndarray, tolerance: float = 1e-8, most: int = 200) -> tuple[np.ndarray, int]:
        """Where Levenberg-Marquardt from x ends, and how often it linearised."""
        x = np.array(x, dtype=np.float64)
        function = self._function("fit", ctypes.c_long)
        looked = function(ctypes.byref(self._task), _pointer(x), ctypes.c_double(tolerance), ctypes.c_long(most))
        return x, int(looked)


def pioneer_task(problem: FitProblem, kind: str) -> CppTask:
    """The Pioneer's problem as C++ sees it."""
    p = problem.numbers
    constants = np.array([p[name] for name in PIONEER_FIXED])
    prior = np.array([(STATE_SCALE / BETA_SPREAD) ** 2, 0.0, 0.0])
    return CppTask("pioneer", kind, problem.inputs, problem.outputs, constants, problem.scale, SIGMA, prior)


def _fit(problem: FitProblem, kind: str) -> Reached:
    x, looked = pioneer_task(problem, kind).fit(problem.start_point)
    return Reached(x, looked, "stopped by its own rule")


def scalar(problem: FitProblem) -> Reached:
    """The fit in scalar C++."""
    return _fit(problem, "scalar")


def simd(problem: FitProblem) -> Reached:
    """The fit in C++ on eight lanes."""
    return _fit(problem, "simd")


assert len(FREE) == _SIZES["pioneer"][0]
