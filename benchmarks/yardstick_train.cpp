// Yardstick of `python -m benchmarks.trains`: one planetary train, plain C++ on one thread.
//
// Sizes are fixed: 17 coordinates (three planets, without the free rotation), 6 meshes, three
// segments a period. In modes an arc turns, and their sizes prove that no mesh comes to its line.
// What they do not prove is read on a grid of tabulated rows, between whose points the sizes, by the
// square of their rates, bound the curve; dips that might hide are halved. The root is that of a
// Taylor series. One tabulated product leads from modes to modes. It records nothing, and refuses
// contact of back flanks: the state at the end is all it gives.
//
//   yardstick_train < NUMBERS
//
// mesh frequency, periods, repeats; stiffness (17 x 17), damping with that of the films, load, lines
// (6 x 17); of the meshes upper and lower stiffness, contact ratio, phase, what contact adds to the
// damping, backlash; displacements, velocities. Coordinates are those in which the mass is 1. Prints
// the least CPU seconds of whole runs and of runs that find their tables, then the final state.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <memory>
#include <vector>

#include "yardstick_modes.hpp"

namespace {

constexpr double NEVER = 1e300;
constexpr double AT_ONCE = 1e-10;  // crossings so many steps apart differ by rounding
constexpr int MOST = 64;

// out += columns times y, `rows` vectors long.
template <int ROWS>
inline void product(const double *columns, const double *y, int count, double *out) {
    V sum[ROWS], more[ROWS];
    for (int r = 0; r < ROWS; ++r) sum[r] = ((const V *)out)[r], more[r] = V{};
    int i = 0;
    for (; i + 1 < count; i += 2) {
        const V *a = (const V *)(columns + i * ROWS * LANES);
        for (int r = 0; r < ROWS; ++r) sum[r] += a[r] * y[i], more[r] += a[ROWS + r] * y[i + 1];
    }
    const V *a = (const V *)(columns + i * ROWS * LANES);
    for (int r = 0; r < ROWS && i < count; ++r) sum[r] += a[r] * y[i];
    for (int r = 0; r < ROWS; ++r) ((V *)out)[r] = sum[r] + more[r];
}

// Modes turn and shrink.
inline void turn(double *y, const double *factor) {
    V *u = (V *)y, *v = u + S / LANES;
    const V *c = (const V *)factor, *s = c + S / LANES;
    for (int k = 0; k < S / LANES; ++k) {
        const V real = c[k] * u[k] - s[k] * v[k];
        v[k] = s[k] * u[k] + c[k] * v[k];
        u[k] = real;
    }
}

struct Change {
    alignas(64) double column[Z + 1][W] = {};
};

class Run {
  public:
    explicit Run(const Train &t) : train(t) {
        std::vector<double> cuts{0.0, 1.0};
        for (int j = 0; j < M; ++j)
            for (double side : {-0.5, 0.5}) {
                double cut = t.phase[j] + side * (t.ratio[j] - 1.0);
                cut -= std::floor(cut);
                bool is_new = true;
                for (double c : cuts) is_new &= std::fabs(c - cut) > 1e-9;
                if (is_new) cuts.push_back(cut);
            }
        std::sort(cuts.begin(), cuts.end());
        if (cuts.size() != 4) refuse("three segments are wanted");
        for (int s = 0; s < 3; ++s) {
            length[s] = (cuts[s + 1] - cuts[s]) * 2.0 * M_PI;
            for (int j = 0; j < M; ++j) {
                double off = 0.5 * (cuts[s] + cuts[s + 1]) - t.phase[j];
                off -= std::round(off);
                high[s][j] = std::fabs(off) < 0.5 * (t.ratio[j] - 1.0);
            }
        }
        std::memset(known, -1, sizeof known);
    }

    void forget() {
        std::memset(known, -1, sizeof known);
        for (auto &row : changes)
            for (auto &change : row) change.reset();
        combinations.clear();
    }

    // q and v: velocities by phase.
    void go(double (&z)[Z], int periods) {
        for (int j = 0; j < M; ++j) contact[j] = train.distance(z, j) > 0.0, fresh[j] = false;
        int c = find(0);
        alignas(64) double y[W] = {};
        double from[Z];
        for (int i = 0; i < Z; ++i) from[i] = z[i] - combinations[c]->rest[i];
        for (int i = 0; i < Z; ++i)
            for (int k = 0; k < Z; ++k)
                y[combinations[c]->place(i)] += combinations[c]->into[i][k] * from[k];
        for (int n = 0; n < periods; ++n)
            for (int s = 0; s < 3; ++s) {
                if (const int next = find(s); next != c) change(c, next, y), c = next;
                double left = length[s];
                bool whole = true;
                while (left > 0.0) {
                    const Combination &a = *combinations[c];
                    const double passed = arc(a, y, left, whole ? a.whole[s] : nullptr);
                    whole = false;
                    left = passed < left ? left - passed : 0.0;
                    if (!crossed) continue;
                    const int next = find(s);
                    change(c, next, y), c = next;
                }
            }
        const Combination &a = *combinations[c];
        for (int k = 0; k < Z; ++k) {
            z[k] = a.rest[k];
            for (int i = 0; i < Z; ++i) z[k] += a.out[i][k] * y[a.place(i)];
        }
    }

  private:
    const Train &train;
    double length[3];
    bool high[3][M], contact[M], fresh[M], crossed = false;
    int known[729];
    std::vector<std::unique_ptr<Combination>> combinations;
    std::unique_ptr<Change> changes[MOST][MOST];

    int find(int s) {
        int key = 0;
        for (int j = 0; j < M; ++j) key = 3 * key + (contact[j] ? 1 + high[s][j] : 0);
        if (known[key] < 0) known[key] = make(s);
        return known[key];
    }

    void change(int c, int next, double *y) {
        auto &table = changes[c][next];
        const Combination &a = *combinations[c];
        if (!table) {
            const Combination &b = *combinations[next];
            table = std::make_unique<Change>();
            for (int i = 0; i <= Z; ++i)
                for (int r = 0; r < Z; ++r) {
                    double sum = 0.0;
                    for (int k = 0; k < Z; ++k)
                        sum += b.into[r][k] * (i < Z ? a.out[i][k] : a.rest[k] - b.rest[k]);
                    table->column[i][b.place(r)] = sum;
                }
        }
        alignas(64) double packed[Z], moved[W];
        a.pack(y, packed);
        std::memcpy(moved, table->column[Z], sizeof moved);
        product<W / LANES>(table->column[0], packed, Z, moved);
        std::memcpy(y, moved, sizeof moved);
    }

    // Go as far as nothing happens, at most to the end or over one piece; return the time.
    double arc(const Combination &a, double *y, double left, const double *whole) {
        alignas(64) double size[S];
        for (int k = 0; k < S / LANES; ++k) {
            const V u = ((V *)y)[k], v = ((V *)(y + S))[k], square = u * u + v * v;
            for (int i = 0; i < LANES; ++i) size[k * LANES + i] = std::sqrt(square[i]);
        }
        V reach{}, other{};
        for (int k = 0; k + 1 < a.slots; k += 2) {
            reach += *(const V *)a.swing[k] * size[k];
            other += *(const V *)a.swing[k + 1] * size[k + 1];
        }
        if (a.slots % 2) reach += *(const V *)a.swing[a.slots - 1] * size[a.slots - 1];
        reach += other;
        crossed = false;
        bool open[M], quiet = true;
        for (int j = 0; j < M; ++j) {
            const double from_line = a.contact[j] ? a.level[j] : -a.level[j];
            open[j] = fresh[j] || !a.steady[j] || !(from_line > reach[j]) ||
                      !(train.backlash[j] + a.level[j] > reach[j]);
            quiet &= !open[j];
        }
        if (quiet) {
            if (!whole) return turn_by(a, y, left);
            turn(y, whole);
            drift(a, y, left);
            return left;
        }
        V bend{};
        for (int k = 0; k < a.slots; ++k) bend += *(const V *)a.bend[k] * size[k];
        alignas(64) double packed[Z + 2];
        a.pack(y, packed);
        packed[Z] = packed[Z + 1] = 1.0;
        const double steps = left / a.h;
        const int last = std::min(POINTS, int(std::ceil(steps)));
        alignas(64) double now[LANES] = {};
        product<1>(a.now[0], packed, Z + 1, now);
        // The first step in which some mesh may cross, and those that may.
        int first = last;
        bool may[M] = {};
        alignas(64) double value[M][POINTS];
        for (int j = 0; j < M; ++j) {
            if (!open[j]) continue;
            const double sign = a.contact[j] ? 1.0 : -1.0, band = bend[j];
            std::memset(value[j], 0, sizeof value[j]);
            product<POINTS / LANES>(a.grid[j][0], packed, Z + 2, value[j]);
            for (int i = 0; i < (a.contact[j] ? 0 : last); ++i)
                if (value[j][i] < band - train.backlash[j]) refuse("a back flank touches");
            int k = 0;
            // value[k]: behind step k. A curve from the line lies above the chord less the band.
            if (fresh[j] ? sign * value[j][0] > 4.0 * band
                         : sign * value[j][0] > band && sign * now[j] > band)
                for (k = 1; k < last && sign * value[j][k] > band; ++k) {}
            if (k > first) continue;
            if (k < first) std::memset(may, 0, sizeof may);
            first = k, may[j] = true;
        }
        if (first == last) {
            std::memset(fresh, 0, sizeof fresh);
            return turn_by(a, y, std::min(left, POINTS * a.h));
        }
        // Up to the step, and its curves.
        if (first > 0) {
            turn(y, a.powers[first]);
            drift(a, y, first * a.h);
        }
        a.pack(y, packed);
        const double end = std::min(1.0, steps - first);
        double when[M], soonest = NEVER;
        for (int j = 0; j < M; ++j) {
            when[j] = NEVER;
            if (!may[j]) continue;
            alignas(64) double curve[TERMS] = {};
            product<TERMS / LANES>(a.series[j][0], packed, Z + 2, curve);
            if (!a.contact[j])
                for (double &term : curve) term = -term;
            // From the line on: its root is divided out.
            const int out = fresh[j] && first == 0;
            when[j] = earliest(curve + out, TERMS - out, bend[j], end);
            soonest = std::min(soonest, when[j]);
        }
        std::memset(fresh, 0, sizeof fresh);
        const double part = std::min(soonest, end);
        turn_in_step(a, y, part);
        drift(a, y, part * a.h);
        for (int j = 0; j < M && soonest < NEVER; ++j)
            if (when[j] < soonest + AT_ONCE) contact[j] = !contact[j], fresh[j] = crossed = true;
        return first == last - 1 && part == end && end < 1.0 ? left : (first + part) * a.h;
    }

    // The first fall of a polynomial through zero on [0, end]; it lies above chords less the band.
    static double earliest(const double *curve, int terms, double band, double end) {
        double low = 0.0, width = end;
        const auto at = [&](double t, double &rate) {
            double value = curve[terms - 1];
            rate = 0.0;
            for (int n = terms - 2; n >= 0; --n) {
                rate = rate * t + value;
                value = value * t + curve[n];
            }
            return value;
        };
        double rate, before = curve[0];
        while (low < end) {
            const double high = std::min(low + width, end), here = at(high, rate);
            if (here < 0.0) {
                double a = low, b = high, t = low + (high - low) * before / (before - here);
                for (int i = 0; i < 60; ++i) {
                    const double value = at(t, rate);
                    (value > 0.0 ? a : b) = t;
                    double next = t - value / rate;
                    if (!(next >= a && next <= b)) next = 0.5 * (a + b);
                    const double moved = std::fabs(next - t);
                    t = next;
                    // A step of Newton's method leaves its square.
                    if (moved < 1e-9) break;
                }
                // Something before it may hide, unless the curve falls all along.
                if (width < 1e-7 || rate < -8.0 * band * width) return t;
            } else if (std::min(before, here) > band * width * width || width < 1e-7) {
                low = high, before = here, width *= 2.0;
                continue;
            }
            width *= 0.5;
        }
        return NEVER;
    }

    void drift(const Combination &a, double *y, double t) const {
        for (int k = a.pairs; k < a.slots; ++k) y[k] += a.slope[k] * t;
    }

    // Factors by their series: at most a step of the grid.
    static void turn_in_step(const Combination &a, double *y, double part) {
        alignas(64) double factor[W];
        constexpr int H = S / LANES;
        const V *re = (const V *)a.step, *im = re + H;
        V u[H], v[H];
        for (int k = 0; k < H; ++k) u[k] = V{} + 1.0, v[k] = V{};
        for (int n = TERMS - 1; n > 0; --n) {
            const double share = part / n;
            for (int k = 0; k < H; ++k) {
                const V x = re[k] * u[k] - im[k] * v[k];
                v[k] = share * (im[k] * u[k] + re[k] * v[k]);
                u[k] = 1.0 + share * x;
            }
        }
        for (int k = 0; k < H; ++k) ((V *)factor)[k] = u[k], ((V *)factor)[H + k] = v[k];
        turn(y, factor);
    }

    double turn_by(const Combination &a, double *y, double t) const {
        double steps = t / a.h;
        while (steps >= POINTS) turn(y, a.powers[POINTS]), steps -= POINTS;
        const int k = int(steps);
        if (k > 0) turn(y, a.powers[k]);
        if (steps > k) turn_in_step(a, y, steps - k);
        drift(a, y, t);
        return t;
    }

    int make(int s) {
        if (combinations.size() == MOST) refuse("too many combinations");
        combinations.push_back(std::make_unique<Combination>());
        Combination &a = *combinations.back();
        std::memcpy(a.contact, contact, sizeof contact);
        fill(train, high[s], length, a);
        return int(combinations.size()) - 1;
    }
};

double number() {
    double value;
    if (std::scanf("%lf", &value) != 1) refuse("numbers are missing");
    return value;
}

template <class T>
void read(T &numbers) {
    for (double *x = (double *)&numbers; x < (double *)(&numbers + 1); ++x) *x = number();
}

}  // namespace

int main() {
    Train t;
    t.frequency = number();
    const int periods = int(number()), repeats = int(number());
    read(t.stiffness), read(t.damping), read(t.load), read(t.line), read(t.upper), read(t.lower);
    read(t.ratio), read(t.phase), read(t.contact), read(t.backlash);
    double start[Z], z[Z];
    read(start);
    for (int i = N; i < Z; ++i) start[i] /= 2.0 * M_PI * t.frequency;
    double least[2] = {NEVER, NEVER};
    Run run(t);
    for (int r = 0; r < 2 * repeats; ++r) {
        const std::clock_t begin = std::clock();
        if (r % 2 == 0) run.forget();
        std::memcpy(z, start, sizeof z);
        run.go(z, periods);
        least[r % 2] = std::min(least[r % 2], double(std::clock() - begin) / CLOCKS_PER_SEC);
    }
    std::printf("%.9g %.9g\n", least[0], least[1]);
    for (int i = 0; i < Z; ++i)
        std::printf("%.17g\n", z[i] * (i < N ? 1.0 : 2.0 * M_PI * t.frequency));
}
