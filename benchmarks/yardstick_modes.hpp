// Modes of the combinations of contacts of `yardstick_train.cpp`, and their tables.
//
// Stiffness and damping are symmetric, so that modes project themselves: undamped ones by Jacobi's
// method, then each damped one by inverse iteration.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

constexpr int N = 17, M = 6, Z = 2 * N, LANES = 8;
constexpr int S = 24, W = 2 * S;       // places of modes, filled up: real parts, imaginary parts
constexpr int POINTS = 16, TERMS = 16;  // of the grid of a piece; of series over one of its steps
constexpr double STEP = 0.75;  // of the grid, times the largest rate: 0.75^16 / 16! = 5e-16

using Complex = std::complex<double>;
typedef double V __attribute__((vector_size(64)));

[[noreturn]] void refuse(const char *why) {
    std::fprintf(stderr, "yardstick_train: %s\n", why);
    std::exit(1);
}

struct Train {
    double frequency, stiffness[N][N], damping[N][N], load[N], line[M][N];
    double upper[M], lower[M], ratio[M], phase[M], contact[M], backlash[M];

    double distance(const double *z, int j) const {
        double sum = 0.0;
        for (int i = 0; i < N; ++i) sum += line[j][i] * z[i];
        return sum;
    }
};

struct alignas(64) Combination {
    int pairs = 0, slots = 0;
    alignas(64) double rate[W] = {}, step[W] = {};           // by time; by a step of the grid
    double slope[W] = {}, rest[Z] = {};          // of what drifts; where the others come to rest
    double out[Z][Z] = {}, into[Z][Z] = {};      // out[i]: state of mode i
    alignas(64) double powers[POINTS + 1][W] = {};           // turns over steps of the grid
    alignas(64) double whole[3][W] = {};                     // over whole segments
    alignas(64) double swing[S][LANES] = {}, bend[S][LANES] = {};  // of modes in lines; at a step
    double level[M] = {}, wander[M] = {};
    alignas(64) double now[Z + 1][LANES] = {};  // distances at present
    alignas(64) double grid[M][Z + 2][POINTS] = {}, series[M][Z + 2][TERMS] = {};
    bool contact[M] = {}, steady[M] = {};
    double h = 0.0;

    int place(int i) const { return i < slots ? i : S + i - slots; }
    void pack(const double *y, double *packed) const {
        std::memcpy(packed, y, slots * sizeof(double));
        std::memcpy(packed + slots, y + S, pairs * sizeof(double));
    }
};

void solve(Complex (&a)[N][N], Complex (&x)[N]) {
    for (int c = 0; c < N; ++c) {
        int best = c;
        for (int r = c + 1; r < N; ++r)
            if (std::norm(a[r][c]) > std::norm(a[best][c])) best = r;
        std::swap(x[c], x[best]);
        std::swap(a[c], a[best]);
        // An eigenvalue to rounding: any small number will do.
        if (std::norm(a[c][c]) < 1e-32) a[c][c] = 1e-16;
        const Complex over = 1.0 / a[c][c];
        for (int r = c + 1; r < N; ++r) {
            const Complex share = a[r][c] * over;
            for (int k = c + 1; k < N; ++k) a[r][k] -= share * a[c][k];
            x[r] -= share * x[c];
        }
    }
    for (int c = N - 1; c >= 0; --c) {
        for (int k = c + 1; k < N; ++k) x[c] -= a[c][k] * x[k];
        x[c] /= a[c][c];
    }
}

struct Mode {
    Complex rate, x[N], norm;
    double square;
};

struct Modes {
    double square[N], shape[N][N];     // undamped: shape[i] of mode i
    double own[N][N], load[N];         // damping and load in them
    std::vector<Mode> found;           // damped ones, pairs before real ones
    int pairs;

    Complex pairing(const Mode &p, const Mode &q) const {
        Complex sum = 0.0;
        for (int r = 0; r < N; ++r) {
            sum += (p.rate + q.rate) * p.x[r] * q.x[r];
            for (int l = 0; l < N; ++l) sum += p.x[r] * own[r][l] * q.x[l];
        }
        return sum;
    }
};

// Jacobi's method.
Modes undamped(double (&a)[N][N]) {
    Modes m{};
    for (int i = 0; i < N; ++i) m.shape[i][i] = 1.0;
    double size = 0.0;
    for (int i = 0; i < N; ++i) size = std::max(size, a[i][i]);
    for (int sweep = 0; sweep < 20; ++sweep) {
        bool done = true;
        for (int p = 0; p < N; ++p)
            for (int q = p + 1; q < N; ++q) {
                if (std::fabs(a[p][q]) < 1e-17 * size) continue;
                done = false;
                const double b = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                const double t = std::copysign(1.0, b) / (std::fabs(b) + std::sqrt(b * b + 1.0));
                const double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
                for (int k = 0; k < N; ++k) {
                    const double u = a[p][k], v = a[q][k];
                    a[p][k] = c * u - s * v, a[q][k] = s * u + c * v;
                    const double x = m.shape[p][k], y = m.shape[q][k];
                    m.shape[p][k] = c * x - s * y, m.shape[q][k] = s * x + c * y;
                }
                for (int k = 0; k < N; ++k) {
                    const double u = a[k][p], v = a[k][q];
                    a[k][p] = c * u - s * v, a[k][q] = s * u + c * v;
                }
            }
        if (done) break;
    }
    // What nothing holds has frequency 0, not its rounding.
    for (int i = 0; i < N; ++i) m.square[i] = a[i][i] > 1e-14 * size ? a[i][i] : 0.0;
    return m;
}

// Damped modes by inverse iteration with the Rayleigh functional.
void damp(Modes &m) {
    std::vector<Mode> real, &found = m.found;
    for (int i = 0; i < N; ++i)
        for (int branch = 0; branch < 2; ++branch) {
            const double half = 0.5 * m.own[i][i], under = m.square[i] - half * half;
            if (branch && under > 0.0) continue;
            Mode mode{};
            mode.square = m.square[i];
            mode.rate = under > 0.0 ? Complex(-half, std::sqrt(under))
                                    : Complex(-half + (branch ? -1 : 1) * std::sqrt(-under));
            mode.x[i] = 1.0;
            for (int turn = 0; turn < 12; ++turn) {
                Complex q[N][N], u[N], (&x)[N] = mode.x;
                for (int r = 0; r < N; ++r) {
                    u[r] = 2.0 * mode.rate * mode.x[r];
                    for (int l = 0; l < N; ++l) {
                        q[r][l] = mode.rate * m.own[r][l];
                        u[r] += m.own[r][l] * mode.x[l];
                    }
                    q[r][r] += mode.rate * mode.rate + m.square[r];
                }
                solve(q, u);
                std::copy(u, u + N, x);
                // Of equal ones another is taken.
                for (int again = 0; again < 2; ++again)
                    for (const Mode &other : found)
                        if (std::abs(other.rate - mode.rate) < 1e-7 * std::abs(mode.rate)) {
                            const Complex share = m.pairing(other, mode) / other.norm;
                            for (int r = 0; r < N; ++r) mode.x[r] -= share * other.x[r];
                        }
                const auto smaller = [](Complex p, Complex q) {
                    return std::norm(p) < std::norm(q);
                };
                const Complex scale = 1.0 / *std::max_element(x, x + N, smaller);
                Complex xx = 0.0, xc = 0.0, xk = 0.0;
                for (Complex &value : x) value *= scale;
                for (int r = 0; r < N; ++r) {
                    Complex cx = 0.0;
                    for (int l = 0; l < N; ++l) cx += m.own[r][l] * x[l];
                    xx += x[r] * x[r], xc += x[r] * cx, xk += m.square[r] * x[r] * x[r];
                }
                // Of both roots the nearer one.
                const Complex root = std::sqrt(xc * xc - 4.0 * xx * xk);
                Complex near = (-xc + root) / (2.0 * xx), far = (-xc - root) / (2.0 * xx);
                if (std::norm(far - mode.rate) < std::norm(near - mode.rate)) std::swap(near, far);
                const double moved = std::abs(near - mode.rate);
                mode.rate = near;
                if (moved < 1e-13 * (std::abs(near) + 1.0)) break;
            }
            mode.norm = m.pairing(mode, mode);
            (under > 0.0 ? found : real).push_back(mode);
        }
    m.pairs = int(found.size());
    found.insert(found.end(), real.begin(), real.end());
}

// Fill the tables of a combination whose contacts are set.
void fill(const Train &train, const bool (&high)[M], const double (&length)[3], Combination &a) {
    const double unit = 2.0 * M_PI * train.frequency;
    double k[N][N], c[N][N];
    for (int i = 0; i < N; ++i)
        for (int l = 0; l < N; ++l) {
            k[i][l] = train.stiffness[i][l] / (unit * unit), c[i][l] = train.damping[i][l] / unit;
            for (int j = 0; j < M; ++j) {
                if (!a.contact[j]) continue;
                const double both = train.line[j][i] * train.line[j][l];
                k[i][l] += (high[j] ? train.upper[j] : train.lower[j]) * both / (unit * unit);
                c[i][l] += train.contact[j] * both / unit;
            }
        }
    Modes m = undamped(k);
    double rotated[N][N];
    for (int i = 0; i < N; ++i) {
        for (int l = 0; l < N; ++l) {
            rotated[i][l] = 0.0;
            for (int q = 0; q < N; ++q) rotated[i][l] += m.shape[i][q] * c[q][l];
            m.load[i] += m.shape[i][l] * train.load[l] / (unit * unit);
        }
    }
    for (int i = 0; i < N; ++i)
        for (int l = 0; l < N; ++l) {
            m.own[i][l] = 0.0;
            for (int q = 0; q < N; ++q) m.own[i][l] += rotated[i][q] * m.shape[l][q];
        }
    damp(m);
    a.pairs = m.pairs, a.slots = int(m.found.size());
    if (a.pairs + a.slots != Z || a.slots > S) refuse("modes are missing");
    double largest = 0.0;
    for (const Mode &one : m.found) largest = std::max(largest, std::abs(one.rate));
    a.h = STEP / largest;
    for (int i = 0; i < a.slots; ++i) {
        const Mode &one = m.found[i];
        const bool pair = i < a.pairs, still = one.square == 0.0 && std::abs(one.rate) < 1e-9;
        const Complex rate = still ? 0.0 : one.rate;
        a.rate[i] = rate.real(), a.rate[S + i] = rate.imag();
        a.step[i] = rate.real() * a.h, a.step[S + i] = rate.imag() * a.h;
        Complex force = 0.0, shape[N], left[N], beta[M];
        for (int r = 0; r < N; ++r) {
            shape[r] = left[r] = 0.0;
            for (int l = 0; l < N; ++l) {
                shape[r] += one.x[l] * m.shape[l][r];
                Complex row = rate * one.x[l];
                for (int q = 0; q < N; ++q) row += m.own[l][q] * one.x[q];
                left[r] += row * m.shape[l][r];
            }
            force += one.x[r] * m.load[r];
        }
        const Complex over = (pair ? 2.0 : 1.0) / one.norm;
        force *= over;
        const int im = a.slots + i;
        for (int r = 0; r < N; ++r) {
            const Complex w = over * left[r], v = over * shape[r], moving = rate * shape[r];
            a.into[i][r] = w.real(), a.into[i][N + r] = v.real();
            a.out[i][r] = shape[r].real(), a.out[i][N + r] = moving.real();
            if (pair) {
                a.into[im][r] = w.imag(), a.into[im][N + r] = v.imag();
                a.out[im][r] = -shape[r].imag(), a.out[im][N + r] = -moving.imag();
            }
        }
        const Complex rest = still ? 0.0 : -force / rate;
        if (still) a.slope[i] = force.real();
        for (int r = 0; r < N; ++r) {
            a.rest[r] += (rest * shape[r]).real();
            a.rest[N + r] += (rest * rate * shape[r]).real();
        }
        for (int j = 0; j < M; ++j) {
            beta[j] = 0.0;
            for (int r = 0; r < N; ++r) beta[j] += train.line[j][r] * shape[r];
            a.now[i][j] = beta[j].real();
            if (pair) a.now[im][j] = -beta[j].imag();
            a.swing[i][j] = std::abs(beta[j]);
            a.bend[i][j] = std::abs(beta[j]) * std::norm(rate * a.h) / 8.0;
            if (still && std::abs(beta[j]) > 1e-12) a.wander[j] += (beta[j] * force).real();
        }
        for (int s = 0; s < 3; ++s) {
            const Complex f = std::exp(rate * length[s]);
            a.whole[s][i] = f.real(), a.whole[s][S + i] = f.imag();
        }
        for (int p = 0; p <= POINTS; ++p) {
            const Complex f = std::exp(rate * (a.h * p));
            a.powers[p][i] = f.real(), a.powers[p][S + i] = f.imag();
            for (int j = 0; j < M && p > 0; ++j) {
                const Complex g = beta[j] * f;
                a.grid[j][i][p - 1] = g.real();
                if (pair) a.grid[j][im][p - 1] = -g.imag();
            }
        }
        for (int j = 0; j < M; ++j) {
            Complex term = beta[j];
            for (int n = 0; n < TERMS; ++n) {
                a.series[j][i][n] = term.real();
                if (pair) a.series[j][im][n] = -term.imag();
                term *= rate * (a.h / (n + 1));
            }
        }
    }
    for (int j = 0; j < M; ++j) {
        a.level[j] = a.now[Z][j] = train.distance(a.rest, j);
        a.steady[j] = a.wander[j] == 0.0;
        for (int p = 0; p < POINTS; ++p)
            a.grid[j][Z][p] = a.level[j], a.grid[j][Z + 1][p] = a.wander[j] * a.h * (p + 1);
        a.series[j][Z][0] = a.level[j], a.series[j][Z][1] = a.wander[j] * a.h;
    }
    double worst = 0.0;
    for (int i = 0; i < Z; ++i)
        for (int l = 0; l < Z; ++l) {
            double sum = i == l ? -1.0 : 0.0;
            for (int q = 0; q < Z; ++q) sum += a.into[i][q] * a.out[l][q];
            worst = std::max(worst, std::fabs(sum));
        }
    if (!(worst < 1e-11)) refuse("modes are not apart");
}

}  // namespace
