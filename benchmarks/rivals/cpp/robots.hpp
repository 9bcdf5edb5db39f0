// The robots of the C++ rivals: one integration step each, jaxid's own (`jaxid/simulation`), written out by hand.
//
// Before a step the dry-friction torques that bring every rubbing speed to rest, limited by the mean Coulomb level over the
// step (projected Gauss-Seidel); then one Runge-Kutta 4 step with these held. S is a number or a dual number, R the number
// inside. Free parameters are the first of `p`, the others are `fixed_numbers`.
#pragma once
#include "numbers.hpp"

// Change of an axis' torque towards what stops it; `end` is its speed after the step without its own friction.
template <class S> inline S limited(const S& end, const S& start, const S& torque, const S& own, const S& level, double h) {
    S pull = (end - start) * (1.0 / h), resisting = own * level;
    S turned = share(-start * reciprocal(h * at_least(pull + resisting, 1e-30)));
    S high = level - 2.0 * (level * turned);
    turned = share(start * reciprocal(h * at_least(resisting - pull, 1e-30)));
    S low = 2.0 * (level * turned) - level;
    return least(most(end * reciprocal(h * own), low), high) - torque;
}

// Runge-Kutta 4 over h seconds: `rates(x, dx)`.
template <class S, int n, class Rates> inline void runge_kutta(S x[n], double h, const Rates& rates) {
    const double reach[4] = {0.0, 0.5, 0.5, 1.0}, part[4] = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
    S here[n], slope[n], after[n];
    for (int i = 0; i < n; i++) after[i] = here[i] = x[i];
    for (int stage = 0; stage < 4; stage++) {
        if (stage) for (int i = 0; i < n; i++) here[i] = x[i] + slope[i] * (h * reach[stage]);
        rates(here, slope);
        for (int i = 0; i < n; i++) after[i] = after[i] + slope[i] * (h * part[stage]);
    }
    for (int i = 0; i < n; i++) x[i] = after[i];
}

// Pioneer (Innocenti et al.). Free: I0, Ir1, Ir, Cs, Cv, Cs1, Cv1.
// Fixed: m1, R1, Ip1, d, M, m, R, xm, ym, Ip, L, l1, tr, mu, KT, Ra, KE, tau_fr. State beta, eta1, eta2.
template <class S, class R> struct Pioneer {
    static constexpr int free = 7, states = 3, inputs = 2, outputs = 2;
    S rolling, swivelling, j11, j22, coulomb, caster_coulomb, viscous, caster_viscous;
    double coupling, lever, l1, d, b1, b2, per_volt, emf;

    Pioneer(const S* p, const double* c) {
        const double m1 = c[0], R1 = c[1], Ip1 = c[2], M = c[4], m = c[5], Rw = c[6], xm = c[7], ym = c[8], Ip = c[9], L = c[10];
        d = c[3], l1 = c[11];
        S wheels = 2.0 * (p[2] * (1.0 / (Rw * Rw)) + m);
        rolling = p[1] * (1.0 / (R1 * R1)) + m1;
        swivelling = fixed(p[0], Ip1 / (d * d));
        j11 = wheels + M;
        j22 = wheels * (L * L) + p[0] + (M * (xm * xm + ym * ym) + 2 * Ip);
        coupling = M * xm, lever = M * ym, b1 = 1 / Rw, b2 = L / Rw;
        per_volt = c[12] * c[13] * c[14] / c[15], emf = c[16] * c[12];
        coulomb = p[3] + c[12] * c[13] * c[17], viscous = p[4] + per_volt * emf;
        caster_coulomb = p[5], caster_viscous = p[6];
    }
    void inverse_inertia(const S& s, const S& c, S& i11, S& i12, S& i22) const {
        S ss = s * s, cc = c * c;
        S a = j11 + rolling * cc + swivelling * ss, e = j22 + (l1 * l1) * (rolling * ss + swivelling * cc);
        S b = l1 * ((swivelling - rolling) * (s * c)) + coupling, scale = reciprocal(a * e - b * b);
        i11 = e * scale, i12 = -b * scale, i22 = a * scale;
    }
    void rates(const S x[3], R push, R turn_push, const S dry[3], S dx[3], S i[3], S caster[2]) const {
        S s, c;
        sine_cosine(x[0], s, c);
        inverse_inertia(s, c, i[0], i[1], i[2]);
        caster[0] = s * (-1.0 / d), caster[1] = c * (-l1 / d) + -1.0;
        S turn = caster[0] * x[1] + caster[1] * x[2];
        S pulled = caster_viscous * turn + dry[2], side = l1 * x[2];
        S across = rolling * turn * (s * x[1] + c * side), along = swivelling * turn * (c * x[1] - s * side);
        S force = (2 * b1 * b1) * (viscous * x[1]), moment = (2 * b2 * b2) * (viscous * x[2]);
        force = plus(-force - b1 * (dry[0] + dry[1]) - caster[0] * pulled - s * along + c * across + lever * (x[2] * x[2]), push);
        moment = plus(-moment - b2 * (dry[0] - dry[1]) - caster[1] * pulled - l1 * (s * across + c * along) - lever * (x[2] * x[1]), turn_push);
        dx[0] = turn, dx[1] = i[0] * force + i[1] * moment, dx[2] = i[1] * force + i[2] * moment;
    }
    void step(S x[3], const R u[2], double h) const {
        R push = (b1 * per_volt) * (u[0] + u[1]), turn_push = (b2 * per_volt) * (u[0] - u[1]);
        S dry[3], dx[3], i[3], caster[2], lever_1[3], lever_2[3], slip[3], speed[3], compliance[3][3];
        for (int k = 0; k < 3; k++) dry[k] = fixed(x[0], 0.0);
        rates(x, push, turn_push, dry, dx, i, caster);
        lever_1[0] = lever_1[1] = fixed(x[0], b1), lever_2[0] = fixed(x[0], b2), lever_2[1] = fixed(x[0], -b2);
        lever_1[2] = caster[0], lever_2[2] = caster[1];
        for (int k = 0; k < 3; k++) {
            S one = k < 2 ? b1 * x[1] : lever_1[2] * x[1], two = k < 2 ? (k ? -b2 : b2) * x[2] : lever_2[2] * x[2];
            S faster_1 = k < 2 ? b1 * dx[1] : lever_1[2] * dx[1], faster_2 = k < 2 ? (k ? -b2 : b2) * dx[2] : lever_2[2] * dx[2];
            speed[k] = one + two, slip[k] = speed[k] + h * (faster_1 + faster_2);
            S moved_1 = k < 2 ? b1 * i[0] + (k ? -b2 : b2) * i[1] : i[0] * lever_1[2] + i[1] * lever_2[2];
            S moved_2 = k < 2 ? b1 * i[1] + (k ? -b2 : b2) * i[2] : i[1] * lever_1[2] + i[2] * lever_2[2];
            compliance[0][k] = b1 * moved_1 + b2 * moved_2, compliance[1][k] = b1 * moved_1 - b2 * moved_2;
            compliance[2][k] = lever_1[2] * moved_1 + lever_2[2] * moved_2;
        }
        for (int sweep = 0; sweep < 2; sweep++)
            for (int k = 0; k < 3; k++) {
                S own = compliance[k][k];
                S change = limited(slip[k] + h * (own * dry[k]), speed[k], dry[k], own, k == 2 ? caster_coulomb : coulomb, h);
                dry[k] = dry[k] + change;
                for (int j = 0; j < 3; j++) slip[j] = slip[j] - h * (compliance[j][k] * change);
            }
        runge_kutta<S, 3>(x, h, [&](const S* at, S* slope) { rates(at, push, turn_push, dry, slope, i, caster); });
    }
    void output(const S x[3], S y[2]) const { y[0] = x[1], y[1] = x[2]; }
};

// Omni (Conceicao et al.). Free: J, Bv, Bvn, Bw, Cv, Cvn, Cw. Fixed: M, b, r, l, Kt, Kv, Ra, supply. State V, Vn, W.
template <class S, class R> struct Omni {
    static constexpr int free = 7, states = 3, inputs = 4, outputs = 3;
    S viscous[3], coulomb[3], light[3];
    double per_volt, arm, supply;

    Omni(const S* p, const double* c) {
        const double M = c[0], b = c[1], r = c[2], l = c[3], back = c[5] * l / r;
        per_volt = l * c[4] / (c[6] * r), arm = b, supply = c[7];
        light[0] = light[1] = fixed(p[0], 1 / M), light[2] = reciprocal(p[0]);
        viscous[0] = p[1] + 2 * per_volt * back, viscous[1] = p[2] + 2 * per_volt * back;
        viscous[2] = p[3] + 4 * b * b * per_volt * back;
        for (int i = 0; i < 3; i++) coulomb[i] = p[4 + i];
    }
    void rates(const S x[3], const R push[3], const S dry[3], S dx[3]) const {
        dx[0] = plus(-(viscous[0] * x[0]) - dry[0], push[0]) * light[0] + x[2] * x[1];
        dx[1] = plus(-(viscous[1] * x[1]) - dry[1], push[1]) * light[1] - x[2] * x[0];
        dx[2] = plus(-(viscous[2] * x[2]) - dry[2], push[2]) * light[2];
    }
    void step(S x[3], const R u[4], double h) const {
        R v[4], none{};
        for (int i = 0; i < 4; i++) v[i] = least<R>(most<R>(u[i], none - supply), none + supply);
        R push[3] = {per_volt * (v[3] - v[1]), per_volt * (v[0] - v[2]), (arm * per_volt) * (v[0] + v[1] + v[2] + v[3])};
        S dry[3], dx[3], nothing = fixed(x[0], 0.0);
        for (int i = 0; i < 3; i++) dry[i] = nothing;
        rates(x, push, dry, dx);  // the axes do not push one another: one sweep solves for their torques
        for (int i = 0; i < 3; i++) dry[i] = limited(x[i] + h * dx[i], x[i], nothing, light[i], coulomb[i], h);
        runge_kutta<S, 3>(x, h, [&](const S* at, S* slope) { rates(at, push, dry, slope); });
    }
    void output(const S x[3], S y[3]) const { for (int i = 0; i < 3; i++) y[i] = x[i]; }
};

// A driven pendulum. Free: inertia I, weight times lever W, viscous friction b. Fixed: gear k. State angle, speed.
//     I speed' = k u - b speed - W sin(angle)
template <class S, class R> struct Pendulum {
    static constexpr int free = 3, states = 2, inputs = 1, outputs = 2;
    S light, weight, viscous;
    double gear;

    Pendulum(const S* p, const double* c) : light(reciprocal(p[0])), weight(p[1]), viscous(p[2]), gear(c[0]) {}
    void step(S x[2], const R u[1], double h) const {
        R push = gear * u[0];
        runge_kutta<S, 2>(x, h, [&](const S* at, S* slope) {
            S s, c;
            sine_cosine(at[0], s, c);
            slope[0] = at[1];
            slope[1] = plus(-(viscous * at[1]) - weight * s, push) * light;
        });
    }
    void output(const S x[2], S y[2]) const { y[0] = x[0], y[1] = x[1]; }
};
