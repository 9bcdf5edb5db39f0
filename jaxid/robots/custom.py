"""A user's own robot: any pure `dynamics(state, input, params)` with a table of parameters."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from ..logs import Channels
from ..parameters import Parameter, ParameterError, ParameterTable
from .effect import Levels, Numbers, Path, Scalar, State
from .robot import Robot


@dataclass(frozen=True, kw_only=True)
class Custom(Robot):
    """A robot described by the user's own pure functions of scalars by name.

    - `dynamics(state, input, params) -> {state name: time derivative}`, with `input` by channel name. With dry friction
      it takes a fourth argument, the friction forces by axis name, positive when they resist positive speed.
    - `output(state, input, params) -> {channel: value}`; by default the states named like the output channels.
    - `dry_friction = {axis: (state that is the rubbing speed, parameter that is the Coulomb level)}` makes those axes
      truly stick.

    Raises `ParameterError` if outputs, friction axes or parameters do not fit together.
    """

    dynamics: Callable[..., Mapping[str, Scalar]]
    state_names: tuple[str, ...]
    own_channels: Channels
    table: Mapping[str, Parameter] = field(hash=False, compare=False)
    output: Callable[..., Mapping[str, Scalar]] | None = None
    dry_friction: tuple[tuple[str, str, str], ...] = ()
    start: Mapping[str, float] = field(default_factory=dict, hash=False, compare=False)
    title: str = "custom"

    max_step: ClassVar[float] = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.dry_friction, Mapping):
            axes = tuple((axis, speed, level) for axis, (speed, level) in self.dry_friction.items())
            object.__setattr__(self, "dry_friction", axes)
        measured = (*self.own_channels.outputs, *self.own_channels.optional)
        if self.output is None and not set(measured) <= set(self.state_names):
            missing = ", ".join(sorted(set(measured) - set(self.state_names)))
            raise ParameterError(
                f"outputs {missing} are not states; pass `output=` to say how they follow from the state"
            )
        for axis, speed, level in self.dry_friction:
            if speed not in self.state_names or level not in self.table:
                raise ParameterError(
                    f"dry friction of axis {axis!r} names speed {speed!r} and level {level!r}; "
                    "the first must be a state and the second a parameter"
                )

    @property
    def channels(self) -> Channels:  # type: ignore[override]
        return self.own_channels

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.title

    @property
    def states(self) -> tuple[str, ...]:
        return (*self.state_names, *self.extra_states)

    @property
    def estimated_states(self) -> tuple[str, ...]:
        return self.state_names

    def defaults(self) -> ParameterTable:
        return ParameterTable(self.table)

    def initial_state(self) -> dict[str, float]:
        return dict.fromkeys(self.states, 0.0) | dict(self.start)

    def rubbing(self, state: State, p: Numbers) -> Path:
        return tuple(state[speed] for _, speed, _ in self.dry_friction)

    def coulomb(self, state: State, p: Numbers) -> Levels:
        levels: Levels = tuple((p[level], p[level]) for _, _, level in self.dry_friction)
        speeds = self.rubbing(state, p)
        for effect in self.effects:
            levels = effect.dry(levels, speeds, state, p)
        return levels

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Path:
        return tuple(rates[speed] for _, speed, _ in self.dry_friction)

    def rates(self, state: State, inputs: Path, dry: Path, p: Numbers) -> State:
        named = dict(zip(self.own_channels.inputs, inputs, strict=True))
        own = {name: state[name] for name in self.state_names}
        if self.dry_friction:
            friction = {axis: torque for (axis, _, _), torque in zip(self.dry_friction, dry, strict=True)}
            rates = dict(self.dynamics(own, named, p, friction))
        else:
            rates = dict(self.dynamics(own, named, p))
        for effect in self.effects:
            rates |= effect.rates(state, inputs, p)
        return rates

    def observe(self, state: State, inputs: Path, p: Numbers) -> Path:
        measured = (*self.own_channels.outputs, *self.own_channels.optional)
        if self.output is None:
            return tuple(state[name] for name in measured)
        named = dict(zip(self.own_channels.inputs, inputs, strict=True))
        outputs = self.output(state, named, p)
        return tuple(outputs[name] for name in measured)
