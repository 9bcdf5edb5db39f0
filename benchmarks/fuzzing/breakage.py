"""What a breakage is: a pure function from a good log and a random generator to the bytes of a broken file."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from .good import Good

Make = Callable[[Good, np.random.Generator], bytes | str | None]


@dataclass(frozen=True)
class Breakage:
    """One way to break a log.

    - `kind`: the group it is counted in; `name`: what was done; `file`: the name that the file gets.
    - `make`: gives the file, or None where this log cannot show the fault (equal inputs that are swapped).
    - `harmless`: the file still says what the good one said, so it must read as the same numbers. Any other one must
      end in an error or in a finding, unless the numbers are the same.
    """

    kind: str
    name: str
    make: Make
    harmless: bool = False
    file: str = "run.csv"

    def bytes(self, good: Good, seed: Sequence[int]) -> bytes | None:
        """The broken file."""
        made = self.make(good, np.random.default_rng(list(seed)))
        return made.encode() if isinstance(made, str) else made


class Corpus(list[Breakage]):
    """Breakages, in order; each function joins by a decorator that says what it is."""

    def add(self, kind: str, *, harmless: bool = False, file: str = "run.csv") -> Callable[[Make], Make]:
        """Register a function under its own name."""

        def register(make: Make) -> Make:
            self.append(Breakage(kind, make.__name__.strip("_").replace("_", " "), make, harmless, file))
            return make

        return register

    def add_each(
        self, kind: str, makes: Iterable[tuple[str, Make]], *, harmless: bool = False, file: str = "run.csv"
    ) -> None:
        """Register functions under given names."""
        self.extend(Breakage(kind, name, make, harmless, file) for name, make in makes)
