// Yardstick of `make bench`: runs from rest of the one-degree mesh, plain C++ on one thread.
//
// Under-damped contact, linear damping, no inverse mesh. The motion of each stiffness level and of
// the flight is tabulated at equal times, 10 per radian; the first entry below the flank line is
// found by a scan, which gives up where a dip between two entries could hide; Taylor steps lead from
// the entry before to the root. It records nothing: the state at the end is all it gives.
//
//   yardstick C_MAX C_MIN HALF_HIGH LOW BETA BETA_M FIRST LAST TUNINGS PERIODS REPEATS
//
// (stiffness over its mean, phase lengths, damping ratios) prints the least CPU seconds of the
// repeats, then displacement and velocity at the end for every tuning.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

namespace {

constexpr double PER_RADIAN = 10.0;
constexpr int ORDER = 9;  // (1 / 10)^10 / 10! = 3e-17

struct State {
    double u, v;
};

// u'' = pull - 2 a u' - square u, u measured from `rest`: contact, or (square = 0) flight.
struct Motion {
    double a, square, pull, rest, w, h, length, curvature;
    State whole_u, whole_v;
    double uu[ORDER + 1], uv[ORDER + 1], up[ORDER + 1];  // u(t) of a unit start, and of the pull
    std::vector<double> tu, tv, tp, su, sv, sp;          // the same at k h, and the velocities

    Motion(double a_, double square_, double pull_, double rest_, double length_, double rate,
           double span)
        : a(a_), square(square_), pull(pull_), rest(rest_), w(std::sqrt(std::fabs(square - a * a))),
          h(1.0 / (PER_RADIAN * rate)), length(length_) {
        series(uu, 1.0, 0.0, 0.0);
        series(uv, 0.0, 1.0, 0.0);
        series(up, 0.0, 0.0, pull);
        const int n = int(span / h) + 3;
        for (auto *t : {&tu, &tv, &tp, &su, &sv, &sp}) t->resize(n);
        // Entry after entry by the Taylor step of h.
        const State u1 = moved({1.0, 0.0}, h, 0.0), v1 = moved({0.0, 1.0}, h, 0.0);
        const State p1 = moved({0.0, 0.0}, h, 1.0);
        tu[0] = sv[0] = 1.0;
        for (int k = 1; k < n; ++k) {
            tu[k] = tu[k - 1] * u1.u + su[k - 1] * v1.u;
            su[k] = tu[k - 1] * u1.v + su[k - 1] * v1.v;
            tv[k] = tv[k - 1] * u1.u + sv[k - 1] * v1.u;
            sv[k] = tv[k - 1] * u1.v + sv[k - 1] * v1.v;
            tp[k] = tp[k - 1] * u1.u + sp[k - 1] * v1.u + p1.u;
            sp[k] = tp[k - 1] * u1.v + sp[k - 1] * v1.v + p1.v;
        }
        if (length > 0.0) whole_u = after({1.0, 0.0}, length), whole_v = after({0.0, 1.0}, length);
        curvature = square * h * h / 8.0;
    }

    void series(double *c, double u, double v, double force) const {
        c[0] = u, c[1] = v;
        for (int n = 0; n + 2 <= ORDER; ++n)
            c[n + 2] = ((n == 0 ? force : 0.0) - 2.0 * a * (n + 1) * c[n + 1] - square * c[n]) /
                       ((n + 1) * (n + 2));
    }

    State entry(State s, int k) const {
        return {s.u * tu[k] + s.v * tv[k] + tp[k], s.u * su[k] + s.v * sv[k] + sp[k]};
    }

    // A Taylor step of at most 1 / 10 radian, `on` 1 with the pull, 0 without.
    State moved(State s, double t, double on) const {
        // Even and odd powers apart, so that neither waits for the other.
        double c[ORDER + 1];
        for (int n = 0; n <= ORDER; ++n) c[n] = s.u * uu[n] + s.v * uv[n] + on * up[n];
        const double q = t * t;
        double even = c[ORDER - 1], odd = c[ORDER], rise = ORDER * c[ORDER];
        double turn = (ORDER - 1) * c[ORDER - 1];
        for (int n = ORDER - 3; n >= 0; n -= 2) {
            even = even * q + c[n];
            odd = odd * q + c[n + 1];
            rise = rise * q + (n + 1) * c[n + 1];
            if (n > 0) turn = turn * q + n * c[n];
        }
        return {even + t * odd, rise + t * turn};
    }

    State step(State s, double t) const { return moved(s, t, 1.0); }

    State after(State s, double t) const {
        const int k = int(t / h);
        return step(entry(s, k), t - k * h);
    }

    // Across a whole segment.
    State across(State s) const {
        return {s.u * whole_u.u + s.v * whole_v.u, s.u * whole_u.v + s.v * whole_v.v};
    }

    // The time and the velocity at the root of u = line next to the entry k: Halley's method.
    State root(State s, int k, double line) const {
        s = entry(s, k);
        double t = k * h;
        for (int i = 0; i < 8; ++i) {
            const double bend = pull - 2.0 * a * s.v - square * s.u;
            const double newton = (line - s.u) / s.v;
            const double move = newton / (1.0 + 0.5 * newton * bend / s.v);
            t += move;
            s = step(s, move);
            if (std::fabs(move) < 1e-5 * h) break;
        }
        return {t, s.v};
    }

    // The lowest point next to the entry k.
    double lowest(State s, int k) const {
        s = entry(s, k);
        for (int i = 0; i < 8; ++i) {
            const double move = -s.v / (pull - 2.0 * a * s.v - square * s.u);
            s = step(s, move);
            if (std::fabs(move) < 1e-9 * h) break;
        }
        return s.u;
    }
};

[[noreturn]] void refuse(const char *why) {
    std::fprintf(stderr, "yardstick: %s\n", why);
    std::exit(1);
}

// When contact ends before `end`, after `left`, and the velocity then; else a negative time.
State leaving(const Motion &m, State s, State end, double left) {
    if (end.u >= -m.rest && m.w * left < 3.14159 && (s.v >= 0.0 || end.v < 0.0)) return {-1.0, 0.0};
    const double amplitude = std::sqrt(m.square * s.u * s.u + s.v * (s.v + 2.0 * m.a * s.u)) / m.w;
    if (amplitude < m.rest) return {-1.0, 0.0};
    const double band = m.curvature * amplitude, line = -m.rest;
    const int last = int(left / m.h) + 1;
    for (int k = s.v > 0.0 ? 1 : 0; k <= last; ++k) {
        const double u = s.u * m.tu[k] + s.v * m.tv[k];
        if (u >= line + band) continue;
        // Within the band a dip may hide: its lowest point decides.
        if (u >= line && std::fabs(m.entry(s, k).v) > 2.0 * m.h * m.square * amplitude) continue;
        if (u >= line && !(m.lowest(s, k) < line)) continue;
        const State found = m.root(s, k, line);
        return found.u <= left && found.v < 0.0 ? found : State{-1.0, 0.0};
    }
    return {-1.0, 0.0};
}

State run(const Motion &low, const Motion &high, const Motion &flight, int periods) {
    bool contact = true;
    State s{0.0, 0.0};        // displacement from the flank line, velocity
    double air = 0.0;         // what is left of a flight, and the state it began with
    double landing = 0.0, since = 0.0, speed = 0.0;
    for (int n = 0; n < periods; ++n)
        for (int part = 0; part < 3; ++part) {
            const Motion &m = part == 1 ? low : high;
            double t = 0.0;
            while (t < m.length) {
                const double left = m.length - t;
                if (!contact) {
                    if (air > left) {
                        air -= left, since += left;
                        break;
                    }
                    t += air;
                    contact = true;
                    s = {0.0, landing};
                    continue;
                }
                const State from{s.u - m.rest, s.v};
                const State end = t > 0.0 ? m.after(from, left) : m.across(from);
                const State leave = leaving(m, from, end, left);
                if (leave.u < 0.0) {
                    s = {end.u + m.rest, end.v};
                    break;
                }
                t += leave.u;
                speed = leave.v;
                int k = 1;
                while (speed * flight.tv[k] + flight.tp[k] < 0.0)
                    if (++k == int(flight.tv.size())) refuse("a flight beyond the table");
                const State down = flight.root({0.0, speed}, k, 0.0);
                air = down.u, landing = down.v;
                since = 0.0;
                contact = false;
            }
        }
    return contact ? s : flight.after({0.0, speed}, since);
}

}  // namespace

int main(int count, char **words) {
    if (count != 12) refuse("eleven numbers are wanted");
    double p[11];
    for (int i = 0; i < 11; ++i) p[i] = std::atof(words[i + 1]);
    const int tunings = int(p[8]), periods = int(p[9]), repeats = int(p[10]);
    std::vector<State> ends(tunings);
    double least = 1e300;
    for (int r = 0; r < repeats; ++r) {
        const std::clock_t start = std::clock();
        for (int i = 0; i < tunings; ++i) {
            const double nu = tunings > 1 ? p[6] + (p[7] - p[6]) * i / (tunings - 1) : p[6];
            const double a = p[4] / nu, pull = 1.0 / (nu * nu);
            const auto level = [&](double c, double length) {
                return Motion(a, c * pull, 0.0, 1.0 / c, length, std::sqrt(c) / nu, length);
            };
            const Motion high = level(p[0], p[2]), low = level(p[1], p[3]);
            const Motion flight(p[5] / nu, 0.0, pull, 0.0, 0.0, 1.0, 6.0);
            ends[i] = run(low, high, flight, periods);
        }
        const double seconds = double(std::clock() - start) / CLOCKS_PER_SEC;
        if (seconds < least) least = seconds;
    }
    std::printf("%.9g\n", least);
    for (const State &s : ends) std::printf("%.17g %.17g\n", s.u, s.v);
}
