"""Linear algebra runs on one thread inside jaxid and as the caller wants it outside."""

import threadpoolctl

from jaxid._float64 import in_float64


def threads():
    return {pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"}


def test_the_callers_threads_are_back_after_a_call_also_a_failed_one():
    seen = []

    @in_float64
    def inner():
        seen.append(threads())

    @in_float64
    def outer(fails):
        inner()
        seen.append(threads())
        if fails:
            raise RuntimeError

    with threadpoolctl.threadpool_limits(2, user_api="blas"):
        before = threads()
        outer(False)
        assert threads() == before
        try:
            outer(True)
        except RuntimeError:
            pass
        assert threads() == before == {2}
    assert seen == [{1}] * 4
