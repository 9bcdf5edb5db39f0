"""What was once compiled for a model, found again in another process without tracing its functions.

Machine code lies in files called by what it is compiled from. A file called by the model's `identity` says which: where it is
there, nothing is traced, translated or differentiated any more.
"""

import hashlib
import json
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from .._atomic import write_text
from .._kept import folder, make_room
from .machine import loaded_again, machine_words


class Made(NamedTuple):
    """Names of loaded machine code (`machine.loaded`), and numbers that are to be known of it."""

    code: tuple[str, ...]
    numbers: tuple[int, ...] = ()


def remembered(identity: str | None, purpose: str, make: Callable[[], Made]) -> Made:
    """What `make` makes for a `purpose` of the model that has this `identity`, its code loaded.

    Without an identity, or a folder where compiled programs are kept, it is made anew.
    """
    kept = folder()
    if identity is None or kept is None:
        return make()
    key = hashlib.sha256("\n".join([*machine_words(), identity, purpose]).encode()).hexdigest()[:32]
    path = kept / f"jaxid_{key}.json"
    with suppress(OSError, ValueError, TypeError, KeyError):
        found = json.loads(path.read_text())
        made = Made(tuple(map(str, found["code"])), tuple(map(int, found["numbers"])))
        if all(map(loaded_again, made.code)):
            return made
    made = make()
    with suppress(OSError):  # a folder that cannot be written does no harm
        write_text(path, json.dumps(made._asdict()))
        make_room(kept)
    return made
