// What Python calls: for every robot, scalar and in eight lanes, the cost, the linearisation and whole fits.
#include "fit.hpp"

#define RIVAL(NAME, ROBOT, NUMBER)                                                                                        \
    extern "C" double cost_##NAME(const Task* task, const double* x) { return Fit<ROBOT, NUMBER>(*task).cost(x); }         \
    extern "C" double linearise_##NAME(const Task* task, const double* x, double* blocks, double* gradients) {             \
        Fit<ROBOT, NUMBER> fit(*task);                                                                                     \
        double found = fit.linearise(x);                                                                                   \
        std::copy(fit.blocks.begin(), fit.blocks.end(), blocks);                                                           \
        std::copy(fit.gradients.begin(), fit.gradients.end(), gradients);                                                  \
        return found;                                                                                                      \
    }                                                                                                                      \
    extern "C" long fit_##NAME(const Task* task, double* x, double tolerance, long most) {                                 \
        return Fit<ROBOT, NUMBER>(*task).minimise(x, tolerance, most);                                                     \
    }

#ifdef SCALAR
RIVAL(pioneer_scalar, Pioneer, double)
RIVAL(omni_scalar, Omni, double)
RIVAL(pendulum_scalar, Pendulum, double)
#else
RIVAL(pioneer_simd, Pioneer, Eight)
RIVAL(omni_simd, Omni, Eight)
RIVAL(pendulum_simd, Pendulum, Eight)
#endif
