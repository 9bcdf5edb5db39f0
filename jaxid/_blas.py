"""One thread for BLAS and LAPACK while jaxid computes.

NumPy's, SciPy's and, through SciPy, jaxlib's linear algebra divide even small matrices among threads, which on busy cores
wait for one another: a least-squares problem of 3,750 by 26 then takes a hundred times as long. jaxid's are all small.
The caller's setting is back when the call returns.
"""

import threading
from functools import cache
from types import TracebackType
from typing import Any

import threadpoolctl


@cache
def _controller() -> threadpoolctl.ThreadpoolController:
    import scipy.linalg  # noqa: F401  # the libraries to look for must be loaded

    return threadpoolctl.ThreadpoolController()


_lock = threading.Lock()
_depth = 0
_limit: Any = None


class OneBlasThread:
    """Context in which BLAS runs on one thread, in the whole process; calls inside one another cost nothing."""

    def __enter__(self) -> None:
        global _depth, _limit
        with _lock:
            _depth += 1
            if _depth == 1:
                _limit = _controller().limit(limits=1, user_api="blas")
                _limit.__enter__()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        global _depth, _limit
        with _lock:
            _depth -= 1
            if _depth == 0:
                _limit.__exit__(kind, error, trace)
                _limit = None
