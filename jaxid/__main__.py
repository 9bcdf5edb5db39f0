"""`python -m jaxid`: the command `jaxid`."""

from .cli import main

if __name__ == "__main__":
    main()
