// Output error in C++: simulation with forward sensitivities, normal blocks, Levenberg-Marquardt.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>
#include "robots.hpp"

// E experiments of T samples, arrays as NumPy has them: inputs [E, T, inputs], measured [E, T, outputs]. Unknowns: free
// parameters over `scale`, then every experiment's initial state over `state_scale`, whose prior has the weight `prior`.
struct Task {
    long E, T, substeps;
    double interval, state_scale;
    const double *inputs, *measured, *constants, *scale, *sigma, *prior;
};

template <template <class, class> class Robot, class R> struct Fit {
    static constexpr int L = Lanes<R>::count, n = Robot<double, double>::free, s = Robot<double, double>::states;
    static constexpr int U = Robot<double, double>::inputs, Y = Robot<double, double>::outputs, N = s + n;
    typedef Dual<R, N> Moving;
    Task task;
    long G;
    std::vector<R> u, y;                           // lanes side by side: [G, T, U], [G, T, Y]
    std::vector<double> blocks, gradients, costs;  // [E, N, N], [E, N] (initial states first), [E]

    explicit Fit(const Task& given) : task(given), G((given.E + L - 1) / L), u(G * given.T * U), y(G * given.T * Y),
        blocks(given.E * N * N), gradients(given.E * N), costs(given.E) {
        for (long g = 0; g < G; g++)
            for (int l = 0; l < L; l++) {
                long e = std::min(g * L + l, task.E - 1);
                for (long k = 0; k < task.T * U; k++) lane(u[g * task.T * U + k], l) = task.inputs[e * task.T * U + k];
                for (long k = 0; k < task.T * Y; k++) lane(y[g * task.T * Y + k], l) = task.measured[e * task.T * Y + k];
            }
    }
    R start(const double* x, long g, int i) const {
        R found{};
        for (int l = 0; l < L; l++) lane(found, l) = task.state_scale * x[n + s * std::min(g * L + l, task.E - 1) + i];
        return found;
    }
    double prior(const double* x) const {
        double sum = 0;
        for (long e = 0; e < task.E; e++)
            for (int i = 0; i < s; i++) sum += task.prior[i] * x[n + s * e + i] * x[n + s * e + i];
        return 0.5 * sum;
    }
    double cost(const double* x) const {
        R p[n];
        for (int i = 0; i < n; i++) p[i] = R{} + task.scale[i] * x[i];
        Robot<R, R> robot(p, task.constants);
        double total = prior(x), h = task.interval / task.substeps;
        for (long g = 0; g < G; g++) {
            R state[s], shown[Y], sum{};
            for (int i = 0; i < s; i++) state[i] = start(x, g, i);
            for (long t = 0; t < task.T; t++) {
                robot.output(state, shown);
                for (int k = 0; k < Y; k++) {
                    R r = (shown[k] - y[(g * task.T + t) * Y + k]) * (1 / task.sigma[k]);
                    sum += r * r;
                }
                for (long m = 0; m < task.substeps; m++) robot.step(state, &u[(g * task.T + t) * U], h);
            }
            for (int l = 0; l < L && g * L + l < task.E; l++) total += 0.5 * lane(sum, l);
        }
        return total;
    }
    double linearise(const double* x) {
        Moving p[n];
        for (int i = 0; i < n; i++) {
            p[i] = fixed(Moving{}, task.scale[i] * x[i]);
            p[i].d[s + i] = R{} + task.scale[i];
        }
        Robot<Moving, R> robot(p, task.constants);
        double total = prior(x), h = task.interval / task.substeps;
        for (long g = 0; g < G; g++) {
            Moving state[s], shown[Y];
            R block[N][N], gradient[N], sum{};
            for (int i = 0; i < N; i++) {
                gradient[i] = R{};
                for (int j = 0; j < N; j++) block[i][j] = R{};
            }
            for (int i = 0; i < s; i++) {
                state[i] = fixed(Moving{}, 0.0);
                state[i].v = start(x, g, i);
                state[i].d[i] = R{} + task.state_scale;
            }
            for (long t = 0; t < task.T; t++) {
                robot.output(state, shown);
                for (int k = 0; k < Y; k++) {
                    double weight = 1 / task.sigma[k];
                    R r = (shown[k].v - y[(g * task.T + t) * Y + k]) * weight, d[N];
                    for (int i = 0; i < N; i++) d[i] = shown[k].d[i] * weight;
                    sum += r * r;
                    for (int i = 0; i < N; i++) {
                        gradient[i] += r * d[i];
                        for (int j = 0; j <= i; j++) block[i][j] += d[i] * d[j];
                    }
                }
                for (long m = 0; m < task.substeps; m++) robot.step(state, &u[(g * task.T + t) * U], h);
            }
            for (int l = 0; l < L && g * L + l < task.E; l++) {
                long e = g * L + l;
                total += costs[e] = 0.5 * lane(sum, l);
                for (int i = 0; i < N; i++) {
                    gradients[e * N + i] = lane(gradient[i], l);
                    for (int j = 0; j <= i; j++) blocks[(e * N + i) * N + j] = blocks[(e * N + j) * N + i] = lane(block[i][j], l);
                }
                for (int i = 0; i < s; i++) {
                    gradients[e * N + i] += task.prior[i] * x[n + s * e + i];
                    blocks[(e * N + i) * N + i] += task.prior[i];
                }
            }
        }
        return total;
    }
    // The damped Gauss-Newton step of the arrow-shaped system: initial states are eliminated first.
    bool step(double damping, const std::vector<double>& size, std::vector<double>& found) const {
        double S[n][n] = {}, right[n] = {};
        std::vector<double> solved(task.E * s * (n + 1));  // (local block)^-1 [crossed, gradient]
        for (long e = 0; e < task.E; e++) {
            const double *H = &blocks[e * N * N], *g = &gradients[e * N];
            double A[s][s], B[s][n + 1];
            for (int i = 0; i < s; i++) {
                for (int j = 0; j < s; j++) A[i][j] = H[i * N + j];
                A[i][i] += damping * size[n + s * e + i];
                for (int j = 0; j < n; j++) B[i][j] = H[i * N + s + j];
                B[i][n] = g[i];
            }
            if (!solve<s, n + 1>(A, B)) return false;
            for (int i = 0; i < n; i++) {
                right[i] += g[s + i];
                for (int k = 0; k < s; k++) right[i] -= H[k * N + s + i] * B[k][n];
                for (int j = 0; j < n; j++) {
                    S[i][j] += H[(s + i) * N + s + j];
                    for (int k = 0; k < s; k++) S[i][j] -= H[k * N + s + i] * B[k][j];
                }
            }
            for (int i = 0; i < s; i++) for (int j = 0; j <= n; j++) solved[(e * s + i) * (n + 1) + j] = B[i][j];
        }
        double shared[n][1];
        for (int i = 0; i < n; i++) S[i][i] += damping * size[i], shared[i][0] = right[i];
        if (!solve<n, 1>(S, shared)) return false;
        for (int i = 0; i < n; i++) found[i] = -shared[i][0];
        for (long k = 0; k < task.E * s; k++) {
            double sum = -solved[k * (n + 1) + n];
            for (int j = 0; j < n; j++) sum -= solved[k * (n + 1) + j] * found[j];
            found[n + k] = sum;
        }
        return true;
    }
    template <int m, int k> static bool solve(double A[m][m], double B[m][k]) {  // Cholesky
        for (int i = 0; i < m; i++) {
            for (int j = 0; j <= i; j++) {
                double sum = A[i][j];
                for (int q = 0; q < j; q++) sum -= A[i][q] * A[j][q];
                if (i == j) { if (!(sum > 0)) return false; A[i][i] = std::sqrt(sum); }
                else A[i][j] = sum / A[j][j];
            }
        }
        for (int c = 0; c < k; c++) {
            for (int i = 0; i < m; i++) { for (int q = 0; q < i; q++) B[i][c] -= A[i][q] * B[q][c]; B[i][c] /= A[i][i]; }
            for (int i = m - 1; i >= 0; i--) { for (int q = i + 1; q < m; q++) B[i][c] -= A[q][i] * B[q][c]; B[i][c] /= A[i][i]; }
        }
        return true;
    }
    // Levenberg-Marquardt in the columns' own units (More 1978), its damping after Nielsen (1999); stops like SciPy's `lm`
    // and `trf`: a step that lowers the cost by less than `tolerance` of it, or moves by less than that, or a gradient below.
    long minimise(double* x, double tolerance, long most) {
        long total = n + s * task.E, looked = 1;
        std::vector<double> move(total), trial(total), size(total, 0.0), slope(total);
        double here = linearise(x), damping = 1e-3, raise = 2;
        for (; looked < most;) {
            for (int i = 0; i < n; i++) {
                double square = 0;
                slope[i] = 0;
                for (long e = 0; e < task.E; e++) square += blocks[(e * N + s + i) * N + s + i], slope[i] += gradients[e * N + s + i];
                size[i] = std::max(size[i], square);
            }
            for (long e = 0; e < task.E; e++)
                for (int i = 0; i < s; i++) {
                    size[n + s * e + i] = std::max(size[n + s * e + i], blocks[(e * N + i) * N + i]);
                    slope[n + s * e + i] = gradients[e * N + i];
                }
            double steepest = 0;
            for (long i = 0; i < total; i++) steepest = std::max(steepest, std::fabs(slope[i]));
            if (steepest < tolerance) return looked;
            for (;;) {
                double now = INFINITY, promised = 0, length = 0, reach = 0;
                if (step(damping, size, move)) {
                    for (long i = 0; i < total; i++) {
                        trial[i] = x[i] + move[i];
                        promised += 0.5 * move[i] * (damping * size[i] * move[i] - slope[i]);
                        length += move[i] * move[i], reach += x[i] * x[i];
                    }
                    now = cost(trial.data());
                }
                double drop = here - now;
                bool small = drop < tolerance * here && promised < tolerance * here && drop > 0.25 * promised;
                bool short_ = std::sqrt(length) < tolerance * (tolerance + std::sqrt(reach));
                if (drop > 0) {
                    std::copy(trial.begin(), trial.end(), x);
                    double gain = 2 * drop / promised - 1;
                    damping *= std::max(1.0 / 3, 1 - gain * gain * gain), raise = 2;
                    if (small || short_) return looked;
                    break;
                }
                if (short_ || !(damping < 1e30)) return looked;
                damping *= raise, raise *= 2;
            }
            here = linearise(x), looked++;
        }
        return looked;
    }
};
