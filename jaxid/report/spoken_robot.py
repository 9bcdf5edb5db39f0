"""How a line to type names its robot."""

from ..robots import BUILT_IN


def spoken(name: str) -> str:
    """What stands for the robot of this `name` on the command line.

    A robot of the user's own is `package.module:attribute` there, which its title does not tell; ROBOT, as LOGS beside it, is
    what only the reader knows.
    """
    return name if name in BUILT_IN else "ROBOT"
