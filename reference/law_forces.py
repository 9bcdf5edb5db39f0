"""What the laws of `reference.law_table` do at one place of a robot, for equations that are compiled.

Everything reads the vector `e` (effects, then laws) through `K`. Speeds s of axes are rim speeds [m/s].
"""

import numpy as np
from numba import njit

from reference.curves import at
from reference.effects import E
from reference.law_vector import K

AT_REST = 0.02  # rad/s: width of the smooth step of a Coulomb moment against turning
BRISTLE_DAMPING = 0.03  # s
CREEPING = 0.05  # m/s: below this speed, slip is by speed and not by ratio
RAMP_WIDTH = 0.004  # s: how soon a slewing driver is at its full rate


@njit
def rise(s, level, k, lever, e):
    """Dry friction above the Coulomb level of axis k near standstill, in the unit of `level`.

    An absolute excess acts at `lever`: [m] where the axis turns with a body on wheels, 0 where it does not act.
    """
    size = e[K.rise + k] * lever + e[K.relative + k] * level
    if size == 0.0:
        return 0.0
    z, kind = abs(s) / e[K.rise_speed], e[K.rise_kind]
    if kind == -1.0:
        return size / (1.0 + z * z)
    if kind == -2.0:
        return size * at(z / 3.0, e, K.rise_curve)
    return size * np.exp(-(z**kind))


@njit
def load_loss(drive, s, e):
    """Dry friction by the torque that an axis transmits, in its unit."""
    if e[K.load] == 0.0:
        return 0.0
    size = e[K.load] * abs(drive)
    if e[K.load_full] > 0.0:
        size = e[K.load] * e[K.load_full] * at(abs(drive) / e[K.load_full], e, K.load_curve)
    return size if drive * s >= 0.0 else e[K.load_driven] * size


@njit
def dry(coulomb, s, drive, k, lever, e, level):
    """Turn the levels (forwards, backwards) of axis k, which are the plain ones, into the law's."""
    more = rise(s, coulomb, k, lever, e) + load_loss(drive, s, e)
    forwards = 1.0 + e[K.coulomb_asymmetry + k]
    if e[K.one_sided] != 0.0:
        forwards += e[K.one_sided] * (1.0 + at(abs(s), e, K.one_sided_curve))
    level[0, k] = max(0.0, level[0, k] * forwards + more)
    level[1, k] = max(0.0, level[1, k] * (1.0 - e[K.coulomb_asymmetry + k]) + more)


@njit
def bristles(coulomb, s, k, x, xdot, place, e, level):
    """Force of bristles on axis k (Canudas et al. 1995) in place of dry friction, whose levels it takes away.

    x[place + k] is the deflection in units of the one at which a Coulomb force slides. z' = s - sigma0 |s| z / g(s) and
    sigma0 z + sigma1 z' with sigma0 = coulomb / distance and sigma1 = sigma0 * 0.03 s.
    """
    if e[K.bristle] == 0.0 or coulomb == 0.0:
        return 0.0
    g = level[0, k] if s >= 0.0 else level[1, k]
    level[0, k] = level[1, k] = 0.0
    xdot[place + k] = (s - abs(s) * x[place + k] * coulomb / g) / e[K.bristle]
    return coulomb * (x[place + k] + BRISTLE_DAMPING * xdot[place + k])


@njit
def payload(t, e):
    """Mass [kg] that is there at time t beyond the robot's own."""
    if e[K.payload_kind] == 2.0:
        return e[K.payload] * max(0.0, 1.0 - t / e[K.payload_time])
    if e[K.payload_kind] == 3.0:
        return e[K.payload] * (1.0 - at(min(t / e[K.payload_time], 1.0), e, K.payload_curve))
    return e[K.payload]


@njit
def viscous_more(coefficient, rate, s, k, e):
    """Viscous friction of axis k at `rate` beyond coefficient * rate, in the same unit."""
    plain = coefficient * rate
    more = e[K.viscous_asymmetry + k] * (plain if s > 0.0 else -plain)
    if e[K.one_sided_viscous] != 0.0 and s > 0.0:
        more += e[K.one_sided_viscous] * plain * 2.0 * at(s, e, K.one_sided_curve)
    kind, size = e[K.viscous_kind], e[K.viscous_size]
    if kind == 1.0 and s != 0.0:
        more += plain * (np.tanh(size * s) / (size * s) - 1.0)
    elif kind == 2.0:
        more += plain * size * s * s
    elif kind == 3.0:
        more -= plain * size * at(min(abs(s), 1.0), e, K.viscous_curve)
    return more


@njit
def drag_along(v, k, e):
    """Force against speed v [m/s or rad/s] of the body's axis k."""
    force = -e[K.drag + k] * v * abs(v)
    if k == 0:
        force -= e[K.cubic_drag] * v * v * v
        if e[K.drag_force] != 0.0:
            force -= e[K.drag_force] * np.sign(v) * at(abs(v), e, K.drag_curve)
    return force


@njit
def turning_moment(speed, w, e):
    """Moment against the yaw rate w [rad/s] of a body that drives at `speed` [m/s]; smooth, so that it creeps at rest."""
    moment = 0.0
    if e[K.turn_moment] != 0.0:
        along = abs(speed) / e[K.turn_radius] if e[K.turn_radius] > 0.0 else 0.0
        moment -= e[K.turn_moment] * (w / np.sqrt(w * w + along * along + AT_REST**2) + e[K.turn_viscous] * w)
    if e[K.turn_drawn] != 0.0:
        moment -= e[K.turn_drawn] * (np.tanh(w / 0.3) * 0.5 + 0.5 * np.sign(w) * at(abs(w) / 2.0, e, K.turn_curve))
    return moment


@njit
def track_factor(w, e):
    """Effective over drawn track width at yaw rate w."""
    if e[K.track_kind] == 1.0:
        return 1.0 + e[K.track] * np.tanh(w / 0.1)
    if e[K.track_kind] == 2.0:
        return 1.0 + e[K.track] * at(min(abs(w) / 2.0, 1.0), e, K.track_curve)
    return 1.0 + e[K.track]


@njit
def ground(x, y, e):
    """The vector with the floor's laws at (x, y) put into the effects of a slope and of another surface."""
    if e[K.floor_kind] == 0.0 and e[K.slope_kind] == 0.0:
        return e
    here = e.copy()
    kind = e[K.floor_kind]
    if kind > 0.0:
        share = 0.0
        if kind == 1.0:
            share = 1.0 if (x - e[K.floor_x]) ** 2 + (y - e[K.floor_y]) ** 2 < e[K.floor_width] ** 2 else 0.0
        else:
            way = (x * e[K.floor_x] + y * e[K.floor_y] - e[K.floor_offset]) / e[K.floor_width]
            if kind == 2.0:
                share = 0.5 * (1.0 + np.tanh(way))
            else:
                share = at(min(max(0.5 + 0.5 * way, 0.0), 1.0), e, K.floor_curve)
        here[E.surface_coulomb] = here[E.surface_viscous] = share * e[K.floor_change]
        here[E.surface_x] = here[E.surface_y] = 0.0
        here[E.surface_offset] = -1.0  # everywhere beyond the line
    kind, size = e[K.slope_kind], e[K.slope_size]
    if kind == 1.0:
        cos, sin = 1.0, 0.0
        if x > e[K.slope_offset]:
            cos, sin = np.cos(e[K.slope_turn]), np.sin(e[K.slope_turn])
        here[E.slope_x] = size * (cos * e[K.slope_x] - sin * e[K.slope_y])
        here[E.slope_y] = size * (sin * e[K.slope_x] + cos * e[K.slope_y])
    elif kind == 2.0:
        here[E.slope_x], here[E.slope_y] = -size * x, -size * y
    elif kind == 3.0:
        way = (x * e[K.slope_x] + y * e[K.slope_y]) / e[K.slope_offset]
        pull = size * at(min(max(0.5 + 0.5 * way, 0.0), 1.0), e, K.slope_curve)
        here[E.slope_x], here[E.slope_y] = pull * e[K.slope_x], pull * e[K.slope_y]
    return here


@njit
def lagged_command(u, w, n, x, xdot, place, e):
    """Command of motor w of n after its lag; its states are x[place + w] and x[place + n + w]."""
    if e[K.lag + w] > 0.0:
        xdot[place + w] = (u - x[place + w]) / e[K.lag + w]
        return x[place + w]
    if e[K.frequency] > 0.0:
        omega, slope = e[K.frequency], x[place + n + w]
        xdot[place + w] = slope
        xdot[place + n + w] = omega * omega * (u - x[place + w]) - 2.0 * e[K.damping] * omega * slope
        return x[place + w]
    if e[K.slew] > 0.0:
        xdot[place + w] = e[K.slew] * np.tanh((u - x[place + w]) / (e[K.slew] * RAMP_WIDTH))
        return x[place + w]
    return u


@njit
def drop_of(total, x, place, e):
    """Voltage that the supply loses at a total current [A]; x[place] is the slow part's [V], x[place + 1] the charge [A s]."""
    drop = e[K.sag] * total + x[place] + e[K.charge] * x[place + 1]
    if e[K.sag_drop] != 0.0:
        drop += e[K.sag_drop] * at(total / e[K.sag_full], e, K.sag_curve)
    return drop


@njit
def total_current(command, emf, resistance, factor, n):
    """Sum of |i| [A] of n motors whose commands are scaled by the supply's `factor`."""
    total = 0.0
    for w in range(n):
        total += abs(command[w] * factor - emf[w]) / resistance[w]
    return total


@njit
def supplied(command, emf, resistance, n, x, xdot, place, e):
    """Factor by which a supply under load falls short of its nominal voltage: by fixed-point steps, halved if they grow."""
    if e[K.nominal] == 0.0:
        return 1.0
    factor, share, last = 1.0, 1.0, 1e30
    for _ in range(200):
        total = total_current(command, emf, resistance, factor, n)
        change = 1.0 - drop_of(total, x, place, e) / e[K.nominal] - factor
        if abs(change) > 0.7 * last:
            share *= 0.5
        last = abs(change)
        factor += share * change
        if last < 1e-14:
            break
    total = total_current(command, emf, resistance, factor, n)
    if e[K.sag_slow] > 0.0:
        xdot[place] = (e[K.sag_slow] * total - x[place]) / e[K.sag_time]
    xdot[place + 1] = total
    return factor


@njit
def motor_drives(u, rate, back, ohm, gain, radius, n, x, xdot, place, e, drive):
    """Drive torques of n motors: gain * current, the current of u, of `back` * rate [V] and of `ohm`.

    A wheel of `radius` that slips by creep * force * speed turns faster by that, and its back-EMF is larger.

    States from `place` on: two of a lag a motor, the current, the heat [J]; then two of the supply.
    """
    command, emf, resistance, strength = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    supply, heat, winding = place + 4 * n, place + 3 * n, place + 2 * n
    for w in range(n):
        command[w] = lagged_command(u[w], w, n, x, xdot, place, e)
        warm = x[heat + w]
        strength[w] = e[K.strength + w] * (1.0 - e[K.heat_strength] * warm)
        emf[w] = back * strength[w] * rate[w]
        resistance[w] = ohm * e[K.resistance + w] * (1.0 + e[K.heat_resistance] * warm)
        if e[K.creep] > 0.0:
            resistance[w] += back * gain / radius**2 * e[K.creep] * (abs(rate[w]) * radius + CREEPING)
        if e[K.heat_rise] != 0.0:
            resistance[w] *= 1.0 + e[K.heat_rise] * at(warm / e[K.heat_full], e, K.heat_curve)
    factor = supplied(command, emf, resistance, n, x, xdot, supply, e)
    for w in range(n):
        current = (factor * command[w] - emf[w]) / resistance[w]
        if e[K.winding] > 0.0:
            xdot[winding + w] = (current - x[winding + w]) / e[K.winding]
            current = x[winding + w]
        if abs(u[w]) < e[K.freewheel]:
            current = 0.0
        if e[K.no_braking] > 0.0 and current * command[w] <= 0.0:
            share = e[K.no_braking]
            if e[K.no_braking_full] > 0.0:
                share *= at(min(abs(command[w]) / e[K.no_braking_full], 1.0), e, K.no_braking_curve)
            current *= 1.0 - share
        xdot[heat + w] = resistance[w] * current * current
        if e[K.heat_time] > 0.0:
            xdot[heat + w] -= x[heat + w] / e[K.heat_time]
        drive[w] = gain * strength[w] * current


@njit
def gripped(force, w, e):
    """What a wheel w passes to the floor of a force [N]."""
    inverse = e[K.grip + w]
    if inverse == 0.0:
        return force
    if e[K.grip_kind] == 1.0:
        return np.tanh(force * inverse) / inverse
    if e[K.grip_kind] == 2.0:
        full = 2.5 / inverse
        return np.sign(force) * full * at(abs(force) / full, e, K.grip_curve)
    return min(max(force, -1.0 / inverse), 1.0 / inverse)


@njit
def rippled(drive, angle, e):
    """Drive torque with the ripple of a wheel's angle [rad]."""
    turns = e[K.ripple_periods] * angle
    if e[K.ripple_share] != 0.0:
        drive *= 1.0 + e[K.ripple_share] * np.sin(turns)
    if e[K.ripple] != 0.0:
        drive += e[K.ripple] * (np.sin(turns) + e[K.ripple_second] * np.sin(2.0 * turns + e[K.ripple_phase]))
    if e[K.ripple_drawn] != 0.0:
        share = turns / (2.0 * np.pi)
        drive += e[K.ripple_drawn] * at(share - np.floor(share), e, K.ripple_curve)
    return drive


@njit
def filtered(x, xdot, first, n_v, place, e):
    """Sensor filters of the n_v speeds from x[first] on: states x[place : place + 2 n_v]."""
    for k in range(n_v):
        if e[K.sensor_first + k] > 0.0:
            xdot[place + k] = (x[first + k] - x[place + k]) / e[K.sensor_first + k]
            if e[K.sensor_second + k] > 0.0:
                xdot[place + n_v + k] = (x[place + k] - x[place + n_v + k]) / e[K.sensor_second + k]
