// Numbers of the C++ rivals: a double or eight of them side by side, and dual numbers of either.
//
// `Eight` is GCC's own vector type: sums, products, comparisons and `? :` work lane by lane and become vector instructions.
#pragma once
#include <cmath>

typedef double Eight __attribute__((vector_size(64)));

template <class R> struct Lanes { static constexpr int count = 1; };
template <> struct Lanes<Eight> { static constexpr int count = 8; };

inline double& lane(double& x, int) { return x; }
inline double& lane(Eight& x, int i) { return reinterpret_cast<double*>(&x)[i]; }

// Sine and cosine together: reduced to [-pi/4, pi/4] in two parts of pi/2, then their Taylor series, whose remainders are
// below 1e-17 there. Good for angles of some thousands of turns.
template <class R> inline void sine_cosine(R x, R& s, R& c) {
    const double big = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to a whole number
    R n = (x * 0.6366197723675814 + big) - big;
    R r = (x - n * 1.5707963267948966) - n * 6.123233995736766e-17;
    R q = r * r;
    R sr = r + r * q * (-1.0 / 6 + q * (1.0 / 120 + q * (-1.0 / 5040 + q * (1.0 / 362880 + q * (-1.0 / 39916800 +
           q * (1.0 / 6227020800.0 + q * (-1.0 / 1307674368000.0)))))));
    R cr = 1.0 + q * (-0.5 + q * (1.0 / 24 + q * (-1.0 / 720 + q * (1.0 / 40320 + q * (-1.0 / 3628800 +
           q * (1.0 / 479001600.0 + q * (-1.0 / 87178291200.0 + q * (1.0 / 20922789888000.0))))))));
    R quarter = n - 4.0 * ((n * 0.25 - 0.375 + big) - big);  // 0, 1, 2 or 3
    auto odd = (quarter == 1.0) | (quarter == 3.0);
    R a = odd ? cr : sr, b = odd ? sr : cr;
    s = (quarter >= 2.0) ? -a : a;
    c = ((quarter == 1.0) | (quarter == 2.0)) ? -b : b;
}

template <class R> inline R least(R a, R b) { return (a < b) ? a : b; }
template <class R> inline R most(R a, R b) { return (a > b) ? a : b; }

// A value and its derivatives in N directions.
template <class R, int N> struct Dual {
    R v;
    R d[N];
};

template <class R> inline R fixed(R, double x) { return R{} + x; }
template <class R, int N> inline Dual<R, N> fixed(Dual<R, N>, double x) {
    Dual<R, N> y;
    y.v = R{} + x;
    for (int i = 0; i < N; i++) y.d[i] = R{};
    return y;
}

#define DUAL template <class R, int N> inline Dual<R, N>
#define EACH for (int i = 0; i < N; i++)
DUAL operator+(const Dual<R, N>& a, const Dual<R, N>& b) { Dual<R, N> y; y.v = a.v + b.v; EACH y.d[i] = a.d[i] + b.d[i]; return y; }
DUAL operator-(const Dual<R, N>& a, const Dual<R, N>& b) { Dual<R, N> y; y.v = a.v - b.v; EACH y.d[i] = a.d[i] - b.d[i]; return y; }
DUAL operator*(const Dual<R, N>& a, const Dual<R, N>& b) { Dual<R, N> y; y.v = a.v * b.v; EACH y.d[i] = a.v * b.d[i] + b.v * a.d[i]; return y; }
DUAL operator-(const Dual<R, N>& a) { Dual<R, N> y; y.v = -a.v; EACH y.d[i] = -a.d[i]; return y; }
DUAL operator*(const Dual<R, N>& a, double b) { Dual<R, N> y; y.v = a.v * b; EACH y.d[i] = a.d[i] * b; return y; }
DUAL operator*(double b, const Dual<R, N>& a) { return a * b; }
DUAL operator+(const Dual<R, N>& a, double b) { Dual<R, N> y = a; y.v = a.v + b; return y; }
DUAL operator-(double b, const Dual<R, N>& a) { Dual<R, N> y = -a; y.v = b - a.v; return y; }
DUAL plus(const Dual<R, N>& a, R b) { Dual<R, N> y = a; y.v = a.v + b; return y; }
template <class R> inline R plus(R a, R b) { return a + b; }
DUAL reciprocal(const Dual<R, N>& a) { Dual<R, N> y; y.v = 1.0 / a.v; R slope = -y.v * y.v; EACH y.d[i] = slope * a.d[i]; return y; }
template <class R> inline R reciprocal(R a) { return 1.0 / a; }
DUAL least(const Dual<R, N>& a, const Dual<R, N>& b) { Dual<R, N> y; auto first = a.v < b.v; y.v = first ? a.v : b.v; EACH y.d[i] = first ? a.d[i] : b.d[i]; return y; }
DUAL most(const Dual<R, N>& a, const Dual<R, N>& b) { Dual<R, N> y; auto first = a.v > b.v; y.v = first ? a.v : b.v; EACH y.d[i] = first ? a.d[i] : b.d[i]; return y; }
// Within [0, 1], and at least `low`: outside, nothing moves.
DUAL share(const Dual<R, N>& a) { Dual<R, N> y; R none{}; auto in = (a.v > 0.0) & (a.v < 1.0); y.v = least<R>(most<R>(a.v, none), none + 1.0); EACH y.d[i] = in ? a.d[i] : none; return y; }
template <class R> inline R share(R a) { R none{}; return least<R>(most<R>(a, none), none + 1.0); }
DUAL at_least(const Dual<R, N>& a, double low) { Dual<R, N> y; R none{}; auto in = a.v > low; y.v = in ? a.v : none + low; EACH y.d[i] = in ? a.d[i] : none; return y; }
template <class R> inline R at_least(R a, double low) { R none{}; return most<R>(a, none + low); }
template <class R, int N> inline void sine_cosine(const Dual<R, N>& x, Dual<R, N>& s, Dual<R, N>& c) {
    sine_cosine<R>(x.v, s.v, c.v);
    EACH { s.d[i] = c.v * x.d[i]; c.d[i] = -s.v * x.d[i]; }
}
#undef DUAL
#undef EACH

template <class R> inline R& value(R& x) { return x; }
template <class R, int N> inline R& value(Dual<R, N>& x) { return x.v; }
