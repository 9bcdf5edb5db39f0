"""The command line: `jaxid fit`, `jaxid explain`, `jaxid simulate`, `jaxid demo`."""

from .app import main

__all__ = ["main"]
