"""The cases of each set. Every set has seeds of its own; `quick` cases come first and stand in the tables' first rows."""

from dataclasses import dataclass, field

import numpy as np

from reference.law_table import LAWS, applies
from reference.noise import KINDS

ROBOTS = ("pioneer", "omni", "axis")
FIRST_SEED = {"tuning": 20000, "main": 30000, "set_aside": 40000}
"""`tuning` is for development, `main` for the page, `set_aside` is looked at once, after the last change."""
_SHIFT = {"tuning": 0, "main": 1, "set_aside": 2}
COMPLETE = 3
"""Complete models for each robot and kind of noise."""
CONSTANTS = 6
"""Complete models for each robot with known constants off, and as many with a hidden law besides."""
PAIRS = 8
"""Pairs of laws for each robot."""
TRIPLES = 4
"""Three laws of three mechanisms at once, for each robot."""
_BY_SPEED = frozenset(
    (
        "asymmetric_friction",
        "asymmetric_viscous_friction",
        "quadratic_drag",
        "stribeck_friction",
        "sublinear_viscous_friction",
    )
)
"""Forces of the speed alone, of which three laws have one at most: two of them are one curve."""
EARLIER = 77
"""Laws that there were when seeds were first given out; quick cases of later ones have seeds from `_LATER` on."""
_LATER, _REST, _THREE = 200, 1000, 2000
_BEFORE = 90
"""Laws that there were when all other cases were drawn; those of later ones follow, so that no case changes."""


@dataclass(frozen=True)
class Plan:
    """One case: `kind` is "quick", "strength", "complete", "constants", "pair" or "triple"; `laws` the hidden ones."""

    robot: str
    kind: str
    laws: tuple[str, ...]
    strength: str
    seed: int
    noise: str = "white"
    off: bool = field(default=False)

    @property
    def name(self) -> str:
        """Key of the case in the results."""
        what = "+".join(self.laws) or "nothing"
        return f"{self.robot}/{self.kind}/{what}/{self.strength}/{self.noise}{'/off' if self.off else ''}/{self.seed}"


def robots_of(law: str) -> list[str]:
    """Robots that can have a law."""
    return [robot for robot in ROBOTS if applies(law, robot)]


def plans(name: str) -> list[Plan]:
    """All cases of a set. In `quick` each law is hidden once, on another robot in each set, as far as it applies to several."""
    rng = np.random.default_rng(FIRST_SEED[name])
    chosen: list[tuple[str, str, tuple[str, ...], str, str, bool]] = []

    def turn(number: int, law: str, shift: int) -> str:
        own = robots_of(law)
        return own[(number + shift) % len(own)]

    for number, law in enumerate(LAWS):
        chosen.append((turn(number, law, _SHIFT[name]), "quick", (law,), "medium", "white", False))
    quick = [*(chosen[i] for i in rng.permutation(EARLIER)), *chosen[EARLIER:]]
    seeds = [FIRST_SEED[name] + k + (_LATER if k >= EARLIER else 0) for k in range(len(quick))]
    rest: list[tuple[str, str, tuple[str, ...], str, str, bool]] = []
    later: list[tuple[str, str, tuple[str, ...], str, str, bool]] = []
    for strength, shift in (("weak", 1), ("strong", 2)):
        for number, law in enumerate(LAWS):
            own = rest if number < _BEFORE else later
            own.append((turn(number, law, _SHIFT[name] + shift), "strength", (law,), strength, "white", False))
    for robot in ROBOTS:
        own = [law for law in list(LAWS)[:_BEFORE] if applies(law, robot)]
        rest += [(robot, "complete", (), "-", kind, False) for kind in KINDS for _ in range(COMPLETE)]
        rest += [(robot, "constants", (), "-", "white", True) for _ in range(CONSTANTS)]
        rest += [(robot, "constants", (str(rng.choice(own)),), "medium", "white", True) for _ in range(CONSTANTS)]
        for _ in range(PAIRS):
            one, other = rng.choice(len(own), 2, replace=False)
            rest.append((robot, "pair", (own[one], own[other]), "medium", "white", False))
    rest = [*(rest[i] for i in rng.permutation(len(rest))), *later]
    seeds += [FIRST_SEED[name] + _REST + k for k in range(len(rest))]
    three = triples(name)
    seeds += [FIRST_SEED[name] + _THREE + k for k in range(len(three))]
    return [
        Plan(robot, kind, laws, strength, seed, noise, off)
        for seed, (robot, kind, laws, strength, noise, off) in zip(seeds, quick + rest + three, strict=True)
    ]


def triples(name: str) -> list[tuple[str, str, tuple[str, ...], str, str, bool]]:
    """Three laws at once, each case drawn from a seed of its own: no other case changes with them. The other wheel radius is
    left out: the simulator has it as an effect of the plain motors, which laws of motors replace."""
    chosen = []
    for number, robot in enumerate(ROBOTS):
        own = [law for law in list(LAWS)[:_BEFORE] if applies(law, robot) and not law.startswith("wheel_radius")]
        mechanisms = sorted({law.split("/")[0] for law in own})
        for case in range(TRIPLES):
            rng = np.random.default_rng([FIRST_SEED[name], _THREE, number, case])
            three = rng.choice(mechanisms, 3, replace=False)
            while len(_BY_SPEED.intersection(three)) > 1:
                three = rng.choice(mechanisms, 3, replace=False)
            laws = tuple(str(rng.choice([law for law in own if law.split("/")[0] == mechanism])) for mechanism in three)
            chosen.append((robot, "triple", laws, "medium", "white", False))
    return chosen
