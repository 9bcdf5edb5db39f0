"""A user's own robot: any pure `dynamics(state, input, params)` with a table of parameters.

What the dynamics keep to themselves no effect can reach. So a user declares, beside the dynamics, what effects should act
on (`declared.py`): `axes` (where something rubs or drives), `forces` (what a generalised force accelerates),
`motor_currents`, `plane` (how it moves in the plane). A declaration never changes the robot without effects.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import jax
import numpy as np

from ..logs.channels import Channels
from .declared import Declared, takes_friction
from .effect import Levels, Numbers, Scalar, Scalars, State
from .signal_path import overrides
from .trigonometry import sincos


def _asked(function: Callable[..., Any], *named: Mapping[str, Any]) -> Any:
    """What a user's function says. Python's own numbers go in as NumPy's, which do as JAX does: a root of a negative speed is
    no complex number, and a speed of zero below a fraction's line raises nothing."""
    with np.errstate(all="ignore"):
        return function(*({n: np.float64(x) if isinstance(x, float) else x for n, x in part.items()} for part in named))


@cache
def _states(names: tuple[str, ...]) -> Callable[..., Mapping[str, Scalar]]:
    """An output function of these states: the same one for the same names, so that what is compiled for it serves again."""
    return lambda state, inputs, p: {name: state[name] for name in names}


@dataclass(frozen=True, repr=False, kw_only=True)
class Custom(Declared):
    """A robot described by the user's own pure functions of scalars by name.

    - `dynamics(state, input, params) -> {state name: time derivative}`, with `input` by channel name. With axes that rub
      it may take a fourth argument, the friction forces by axis name, positive when they resist positive speed; else these
      act through `forces`.
    - `output(state, input, params) -> {channel: value}`; by default the states named like the output channels.
    - `dry_friction = {axis: (state that is the rubbing speed, parameter that is the Coulomb level)}` makes those axes
      truly stick: short for `axes`.

    What effects need beyond that, each where the robot has it:

    - `axes = {axis: DriveAxis(...)}`.
    - `forces = {velocity: inertia}`, an inertia being a parameter's name, a number or a function `(state, params)`: a
      generalised force on that velocity accelerates it by force over inertia. Or one function
      `(state, forces by velocity, params) -> {velocity: acceleration}` where velocities are coupled. Without, `dynamics`
      that take friction let forces in that way where an axis rubs at each of the velocities.
    - `velocities`: the states that forces accelerate, the one forwards first (default: those of `forces`, else the axes'
      speeds, else the outputs that are states); `turning`: the one that is the yaw rate to the left.
    - `plane = (speed along x, speed along y, yaw rate)` in body axes that are the world's at heading zero, states or ""
      for none; or a function `(state, params)` of the three. `mass`: the parameter that gravity pulls at.
    - `wheel_angles=True`: logs may hold the `angle` of every driven axis beside or in the place of the velocities.
    - `motor_currents(state, input, params) -> {input: current}`, `winding` (parameter: a motor's resistance) and
      `supply_voltage` (number or parameter).
    - `mechanisms = {effect id: parameters}`, such as `{"lateral_com_offset": ("yc",)}`, and `words = {channel: words}`.

    Raises `ParameterError` if outputs, axes or parameters do not fit together, or if `dynamics` and `output`, which are tried
    once on symbols, ask for what does not exist, do not return what they must, or cannot be traced by JAX.
    """

    def showing(self, names: tuple[str, ...]) -> "Custom":
        channels = Channels(inputs=self.own_channels.inputs, outputs=names)
        return replace(self, effects=(), output=_states(names), own_channels=channels, wheel_angles=False, words={})

    def _acts(self, stage: str) -> bool:
        return any(overrides(type(effect), stage) for effect in self.effects)

    def _inputs(self, volts: Scalars) -> State:
        return dict(zip(self.own_channels.inputs, volts, strict=True))

    def _own(self, state: State) -> State:
        return {name: state[name] for name in self.state_names}

    def motor(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        if self.motor_currents is None:
            return volts
        found = _asked(self.motor_currents, self._own(state), self._inputs(volts), p)
        return tuple(found.get(name, 0.0) for name in self.own_channels.inputs)

    def gear(self, currents: Scalars, volts: Scalars, state: State, p: Numbers) -> Scalars:
        """The drive torques as the user gives them; what effects change of them is all that `motion` uses."""
        return self.drive_torques(volts, state, p) if self._acts("torque") else ()

    def drive_torques(self, inputs: Scalars, state: State, p: Numbers) -> Scalars:
        volts = inputs
        if "torque" not in self.stages:
            return ()
        given, own = self._inputs(volts), self._own(state)
        found = (self._axes[i][1].torque for i in self.drive_axes)
        return tuple(_asked(torque, own, given, p) for torque in found if torque is not None)

    def rubbing(self, state: State, p: Numbers) -> Scalars:
        return tuple(state[a.speed] if isinstance(a.speed, str) else _asked(a.speed, state, p) for _, a in self._axes)

    def own_coulomb(self, state: State, p: Numbers) -> Levels:
        return tuple((p[a.coulomb], p[a.coulomb]) if a.coulomb else (0.0, 0.0) for _, a in self._axes)

    def own_viscous(self, speeds: Scalars, state: State, p: Numbers) -> Scalars:
        """Viscous resistance as the user names it; what effects change of it is all that `motion` uses."""
        if not self._acts("viscous"):
            return (0.0,) * len(speeds)
        own = zip(self._axes, speeds, self._viscous_times, strict=True)
        return tuple(p[a.viscous] * s * times if a.viscous else 0.0 * s for (_, a), s, times in own)

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Scalars:
        if all(isinstance(axis.speed, str) for _, axis in self._axes):
            return tuple(rates[axis.speed] for _, axis in self._axes if isinstance(axis.speed, str))
        return super().rubbing_rates(state, rates, p)

    def rim_levers(self, p: Numbers) -> Scalars:
        return tuple(p[axis.lever] if isinstance(axis.lever, str) else float(axis.lever) for _, axis in self._axes)

    def drive_forces(self, torques: Scalars, p: Numbers) -> Scalars:
        levers = self.rim_levers(p)
        return tuple(torque / levers[i] for torque, i in zip(torques, self.drive_axes, strict=True))

    def motion(
        self, state: State, volts: Scalars, torques: Scalars, resisting: Scalars, forces: Scalars, p: Numbers
    ) -> State:
        friction = list(resisting)
        if self._acts("viscous"):  # the dynamics have the axes' own viscous friction
            own = self.own_viscous(self.rubbing(state, p), state, p)
            friction = [r - o for r, o in zip(friction, own, strict=True)]
        for i, changed, own in zip(self.drive_axes, torques, self.gear((), volts, state, p), strict=False):
            friction[i] = friction[i] - (changed - own)
        own_state, given = self._own(state), self._inputs(volts)
        if self._axes and takes_friction(self.dynamics):
            if self._through_friction and self._acts("force"):
                friction = self._pushed_by_friction(friction, forces)
            resisted = dict(zip([a for a, _ in self._axes], friction, strict=True))
            rates = dict(_asked(self.dynamics, own_state, given, p, resisted))
            pushed = self._acts("force") and bool(self.forces)
        else:
            rates = dict(_asked(self.dynamics, own_state, given, p))
            forces = self._with_friction(forces, friction, state, p)
            pushed = self._acts("force") or bool(friction)
        if pushed:
            for name, acceleration in self._accelerations(forces, own_state, p).items():
                rates[name] = rates[name] + acceleration
        return rates

    def _pushed_by_friction(self, friction: list[Scalar], forces: Scalars) -> list[Scalar]:
        """The resisting torques of the axes less the force on the velocity at which each rubs; of several that rub at one, the
        first has it."""
        left, pushed = dict(zip(self.velocities, forces, strict=True)), []
        for resisting, (_, axis) in zip(friction, self._axes, strict=True):
            pushed.append(resisting - left.pop(axis.speed, 0.0) if isinstance(axis.speed, str) else resisting)
        return pushed

    def _with_friction(self, forces: Scalars, friction: list[Scalar], state: State, p: Numbers) -> Scalars:
        """Generalised forces with the resisting torques of the axes, each by its lever on the velocities."""
        changed = list(forces)
        for (_, axis), resisting in zip(self._axes, friction, strict=True):
            for k, name in enumerate(self.velocities):
                if isinstance(axis.speed, str):
                    changed[k] = changed[k] - resisting if axis.speed == name else changed[k]
                else:
                    speed = axis.speed
                    along = {n: 1.0 if n == name else 0.0 for n in state}
                    primal = {n: 1.0 * v for n, v in state.items()}
                    tangent = {n: along[n] + 0.0 * v for n, v in primal.items()}
                    lever = jax.jvp(lambda s, speed=speed: speed(s, p), (primal,), (tangent,))[1]
                    changed[k] = changed[k] - lever * resisting
        return tuple(changed)

    def _accelerations(self, forces: Scalars, state: State, p: Numbers) -> State:
        by_name = dict(zip(self.velocities, forces, strict=True))
        found: State = {}
        if callable(self.forces):
            found.update(_asked(self.forces, state, by_name, p))
            return found
        for name, inertia in self.forces:
            of = p[inertia] if isinstance(inertia, str) else _asked(inertia, state, p) if callable(inertia) else inertia
            found[name] = by_name[name] / of
        return found

    def planar(self, state: State, p: Numbers) -> tuple[Scalar, Scalar, Scalar]:
        if callable(self.plane):
            return _asked(self.plane, state, p)
        along, left, turning = (state[name] if name else 0.0 for name in self.plane)
        return along, left, turning

    def angle_rates(self, state: State, p: Numbers) -> Scalars:
        speeds = self.rubbing(state, p)
        return tuple(speeds[i] for i in self.drive_axes)

    def field_force(self, field: tuple[Scalar, Scalar], state: State, p: Numbers) -> Scalars:
        sine, cosine = sincos(state["theta"])
        along = p[self.mass] * (cosine * field[0] + sine * field[1])
        left = p[self.mass] * (cosine * field[1] - sine * field[0])
        if callable(self.plane):
            return tuple(self._power(name, (along, left), state, p) for name in self.velocities)
        by_name = dict(zip(self.plane[:2], (along, left), strict=True))
        return tuple(by_name.get(name, 0.0) for name in self.velocities)

    def _power(self, velocity: str, force: tuple[Scalar, Scalar], state: State, p: Numbers) -> Scalar:
        """The generalised force at a velocity of a force in body axes: its power for one unit of that velocity."""
        primal = {n: 1.0 * v for n, v in state.items()}
        tangent = {n: (1.0 if n == velocity else 0.0) + 0.0 * v for n, v in primal.items()}
        along, left, _ = jax.jvp(lambda s: self.planar(s, p), (primal,), (tangent,))[1]
        return force[0] * along + force[1] * left

    def observe(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        angles = tuple(state[name] for name in self.measured_angles)
        if self.output is None:
            return (*(state[name] for name in self.own_channels.measured), *angles)
        outputs = _asked(self.output, state, self._inputs(inputs), p)
        return (*(outputs[name] for name in self.own_channels.measured), *angles)
