"""`python -m jaxid.cli` is `jaxid`."""

from .app import main

main()
