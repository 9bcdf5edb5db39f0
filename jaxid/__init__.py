"""jaxid: from a wheeled robot's logs to a model its owner can trust.

import jaxid

logs = jaxid.read_logs("logs/*.csv", robot="pioneer")
fit, held_out = logs.split(held_out=["turns.csv", "crawl.csv"])
ls = jaxid.integral_least_squares(jaxid.Pioneer(), fit)
oe = jaxid.output_error(jaxid.Pioneer(), fit, start=ls)
jaxid.compare(ls, oe, held_out=held_out)
jaxid.explain(oe, fit, held_out)
"""

from typing import Any

import lazy_loader

# Each public name is imported when it is first asked for, from where `__init__.pyi` says, which type checkers read, too:
# JAX, pandas and SciPy take seconds, which `jaxid --help` and a program that needs one of them only shall not wait for.
_get, _, _names = lazy_loader.attach_stub(__name__, __file__)
_PACKAGES = frozenset(
    ("checks", "design", "effects", "estimate", "explanation", "kernel", "logs", "parameters", "report", "robots")
    + ("simulation",)
)
__all__ = [name for name in _names if name not in _PACKAGES]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name in _names:
        return _get(name)
    # Asked for when needed: a checkout that is not installed has no version and can be imported all the same.
    if name == "__version__":
        from importlib.metadata import version

        return version("jaxid-robots")  # the name `jaxid` on the public package index is another package's
    raise AttributeError(f"module 'jaxid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_names, "__version__"})
