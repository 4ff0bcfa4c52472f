/* A gear train as a Co-Simulation FMU of FMI 3.0: engine and interface, C99, no other files.

   With the rigid rotation s phi(t) of the train (phi is the phase of the reference mesh) the
   coordinates q are deviations from it, in SI units:

       M q'' + D q' + K q = B T + f(phi) - M s phi'' - sum_j b_j F_j,   phi'' = s.B T / s.M s,

   with harmonic forces f and the mesh forces F_j of gearlib.models.trains.system. While inputs, contacts and
   stiffness levels stay, phi is a parabola of the time, and q the product of a matrix exponential
   and the state. Its power series, cut below rounding, makes distances of flanks polynomials, whose
   first fall through zero is isolated in Bernstein form: no contact event is missed. */

#pragma GCC diagnostic ignored "-Wunused-parameter" /* the interface has more than is needed */

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model_data.h" /* the constants in capital letters, written by gearlib */

#define PI 3.14159265358979323846
#define DEGREE 30          /* of the power series: 3^31 / 31! = 8e-20 */
#define MAX_RATE_TIME 3.0  /* largest rate of the motion times the length of a piece */
#define SERIES_END 1e-19   /* largest left-out term of a series, as a fraction of the state */
#define ROUNDING 1e-15     /* rounding error of a distance, as a fraction of its terms */
#define ZERO_SUM 1e-14     /* sums below this fraction of their terms count as zero */
#define SAME_INSTANT 1e-13 /* largest time between simultaneous events, as a fraction of a piece */
#define MAX_OVERLAP 1e-13  /* overlap of both flanks that counts as rounding */
#define MAX_DEPTH 48       /* largest number of halvings of a piece */
#define MAX_INTERVALS 1000 /* largest number of intervals of a search */
#define MAX_NEWTON 480     /* largest number of Newton steps; every eighth halves the bracket */
#define MAX_ORDER 10       /* derivatives that decide the contact of a start on a flank line */
#define MAX_STALLED 10000  /* largest number of events at one instant */

enum { COAST_SIDE, DRIVE_SIDE }; /* contact codes are 1, drive side, 0, and -1, coast side */
#define SIDE(code) ((code) == 1 ? DRIVE_SIDE : COAST_SIDE)
enum { JAMMED = 1, UNRESOLVED, STALLED, OVERFLOWED }; /* failures of a run */

/* Everything that changes: it is copied, set and serialised as a whole. */
typedef struct {
    double t;               /* time, s */
    double t0, phase0, rate0, acceleration; /* phi = phase0 + rate0 (t - t0) + acceleration .../2 */
    double q[N], v[N];      /* coordinates, m, and their rates, m/s */
    double torque[B], backlash[M], speed;   /* inputs: N m, m, rad/s */
    int64_t cell[M][2];     /* number of the interval of constant stiffness, by side */
    int32_t contact[M], line[M], order[M];  /* code; line of the mesh, and zeros of its distance */
    int32_t next_contact[M], pending[M];    /* changes of contact that Event Mode applies */
    int32_t events;         /* number of contact events so far */
    int32_t stale, phase_is_set; /* whether contacts, and cells, have to be found anew */
} State;

/* An instance: its state, what the importer asked for, and storage of a piece. */
typedef struct {
    State s;
    void *environment;
    void (*log)(void *, int, const char *, const char *);
    bool logging, event_mode, early_return;
    int degree;
    double q[DEGREE + 2][N], v[DEGREE + 2][N];   /* series of q and v over the piece */
    double wave[DEGREE + 2][2 * H1];             /* series of cosines and sines */
    double d[2][M][DEGREE + 2], e[2][M][DEGREE + 3]; /* series of distances, of deviations */
    double size[2][M][DEGREE + 2];               /* sums of the magnitudes of their terms */
    double force[M];                             /* mesh forces with damping at the start, N */
    double rows[MAX_DEPTH + 2][DEGREE + 2];      /* Bernstein coefficients, width */
    double instant[M], instant_error[M];
    int32_t after[M];
} Instance;

static double binomial[DEGREE + 1][DEGREE + 1];

static void fill_binomials(void) {
    for (int n = 0; n <= DEGREE; n++)
        for (int k = 0; k <= n; k++)
            binomial[n][k] = k == 0 || k == n ? 1.0 : binomial[n - 1][k - 1] + binomial[n - 1][k];
}

/* ---- Rotation and stiffness ---- */

static double rate_at(const State *s, double t) { return s->rate0 + s->acceleration * (t - s->t0); }

static double phase_at(const State *s, double t) {
    return s->phase0 + (t - s->t0) * 0.5 * (s->rate0 + rate_at(s, t));
}

/* Return the phase of the reference mesh at which an interval of constant stiffness begins. */
static double cell_start(int j, int side, int64_t cell) {
    int64_t n = LEVELS[side][j], period = cell / n - (cell % n < 0);
    return 2.0 * PI * ((double)period + LEVEL_PHASE[side][j][cell - period * n]) / RATIO[j];
}

static double stiffness_of(const State *s, int j, int side) {
    int64_t n = LEVELS[side][j], k = s->cell[j][side] % n;
    return LEVEL_VALUE[side][j][k < 0 ? k + n : k];
}

static void find_cells(State *s) {
    double phase = phase_at(s, s->t);
    for (int j = 0; j < M; j++)
        for (int side = 0; side < 2; side++) {
            /* The interval that follows, in the sense of rotation, a phase on a boundary. */
            double near = 1e-13 * (1.0 + fabs(phase)) * (rate_at(s, s->t) < 0.0 ? -1.0 : 1.0);
            int64_t *cell = &s->cell[j][side];
            *cell = LEVELS[side][j] * (int64_t)floor(phase * RATIO[j] / (2.0 * PI)) - 1;
            while (cell_start(j, side, *cell + 1) <= phase + near) ++*cell;
            while (cell_start(j, side, *cell) > phase + near) --*cell;
        }
}

/* Return the time until a distance is covered at a rate and an acceleration, with rate >= 0. */
static double time_to_cover(double distance, double rate, double acceleration) {
    double square = rate * rate + 2.0 * acceleration * fmax(distance, 0.0);
    if (square < 0.0 || (rate <= 0.0 && acceleration <= 0.0)) return INFINITY;
    if (rate > 0.0) return 2.0 * fmax(distance, 0.0) / (rate + sqrt(square));
    return (sqrt(square) - rate) / acceleration;
}

/* Return the time to the next switch of a stiffness, with its mesh, side and step of the cell. */
static double next_switch(const State *s, int *mesh, int *side, int *step) {
    double first = INFINITY, phase = phase_at(s, s->t), rate = rate_at(s, s->t);
    for (int j = 0; j < M; j++)
        for (int i = 0; i < 2; i++) {
            if (LEVELS[i][j] < 2) continue;
            double up = cell_start(j, i, s->cell[j][i] + 1) - phase;
            double down = phase - cell_start(j, i, s->cell[j][i]);
            double t_up = time_to_cover(up, rate, s->acceleration);
            double t_down = time_to_cover(down, -rate, -s->acceleration);
            double t = fmin(t_up, t_down);
            if (t < first) first = t, *mesh = j, *side = i, *step = t_up <= t_down ? 1 : -1;
        }
    return first;
}

/* Return the torque on a body: an input, or what the driver needs to hold the speed. */
static double torque_on(const State *s, int body) {
    double sum = body == DRIVER ? 0.0 : s->torque[body];
    for (int b = 0; b < B && body == DRIVER; b++)
        if (b != DRIVER) sum += DRIVER_SHARE[b] * s->torque[b];
    return sum;
}

/* Let the parabola of the phase begin anew if its inputs have changed. */
static void set_rotation(State *s) {
    double acceleration = 0.0, size = 0.0, rate = rate_at(s, s->t);
    if (PRESCRIBED) rate = s->speed / PINION_RATE;
    for (int b = 0; b < B && !PRESCRIBED; b++) {
        acceleration += TORQUE_RATE[b] * s->torque[b];
        size += fabs(TORQUE_RATE[b] * s->torque[b]);
    }
    if (fabs(acceleration) <= ZERO_SUM * size) acceleration = 0.0; /* balance, up to rounding */
    if (acceleration == s->acceleration && (!PRESCRIBED || rate == s->rate0)) return;
    s->phase0 = phase_at(s, s->t);
    s->t0 = s->t, s->rate0 = rate, s->acceleration = acceleration;
}

/* ---- Power series of a piece ---- */

/* Return an upper bound of the rates of all motions, rad/s, over a time from now. */
static double fastest_rate(const State *s, double time) {
    double rate = fmax(fabs(rate_at(s, s->t)), fabs(rate_at(s, s->t + time)));
    double frame = fabs(FRAME_RATE) * rate;
    double chirp = HIGHEST_HARMONIC * rate + sqrt(HIGHEST_HARMONIC * fabs(s->acceleration));
    return fmax(NORM[0] + frame * (NORM[1] + frame * NORM[2]), chirp);
}

/* Fill the series of the motion over a piece of length h, in powers of its fraction. */
static void fill_series(Instance *x, double h) {
    const State *s = &x->s;
    int n = x->degree;
    double phase = phase_at(s, s->t), rate = rate_at(s, s->t), load[N], level[M];
    double frame = FRAME_RATE * rate;
    for (int i = 0; i < H; i++) {
        double first = HARMONIC[i] * rate * h, second = HARMONIC[i] * s->acceleration * h * h;
        x->wave[0][2 * i] = cos(HARMONIC[i] * phase);
        x->wave[0][2 * i + 1] = sin(HARMONIC[i] * phase);
        for (int k = 0; k <= n; k++) {
            double *a = x->wave[k], *next = x->wave[k + 1], *before = k ? x->wave[k - 1] : NULL;
            double c = first * a[2 * i], b = first * a[2 * i + 1];
            if (k) c += second * before[2 * i], b += second * before[2 * i + 1];
            next[2 * i] = -b / (k + 1), next[2 * i + 1] = c / (k + 1);
        }
    }
    for (int side = 0; side < 2; side++)
        for (int j = 0; j < M; j++)
            for (int k = 0; k <= n + 1; k++) {
                double sum = 0.0, size = 0.0;
                if (k == 0) {
                    sum = CONSTANT[side][j];
                    if (side == COAST_SIDE && HAS_COAST[j]) sum += s->backlash[j];
                    size = fabs(sum);
                }
                for (int i = 0; i < 2 * H; i++) {
                    double term = AMPLITUDE[side][j][i] * x->wave[k][i];
                    sum += term, size += fabs(term);
                }
                x->e[side][j][k] = sum;
                if (k <= n) x->size[side][j][k] = size;
            }
    for (int i = 0; i < N; i++) {
        x->q[0][i] = s->q[i], x->v[0][i] = s->v[i];
        load[i] = LOAD[i] - RIGID[i] * s->acceleration + frame * frame * FRAME_LOAD[i];
        for (int b = 0; b < B; b++) load[i] += TORQUE[b][i] * torque_on(s, b);
    }
    for (int j = 0; j < M; j++) level[j] = stiffness_of(s, j, SIDE(s->contact[j]));
    for (int k = 0; k <= n; k++) {
        const double *q = x->q[k], *v = x->v[k];
        double sum[N];
        for (int i = 0; i < N; i++) {
            double total = k == 0 ? load[i] : 0.0;
            for (int l = 0; l < 2 * H; l++) total += FORCE[i][l] * x->wave[k][l];
            for (int l = 0; l < N; l++) total -= STIFFNESS[i][l] * q[l] + DAMPING[i][l] * v[l];
#if GYROSCOPIC
            for (int l = 0; l < N; l++)
                total -= frame * (FRAME_DAMPING[i][l] * v[l] + FRAME_STIFFNESS[0][i][l] * q[l]
                                  + frame * FRAME_STIFFNESS[1][i][l] * q[l]);
#endif
            sum[i] = total;
        }
        for (int j = 0; j < M; j++) {
            double rates[2] = {0.0, 0.0};
            for (int side = 0; side < 2; side++) {
                double d = x->e[side][j][k], size = 0.0;
                rates[side] = x->e[side][j][k + 1] * (k + 1) / h;
                for (int i = 0; i < N; i++) {
                    double term = LINE[side][j][i] * q[i];
                    d += term, size += fabs(term), rates[side] += LINE[side][j][i] * v[i];
                }
                x->d[side][j][k] = d, x->size[side][j][k] += size;
            }
            double oil = OIL_DAMPING[j] * rates[DRIVE_SIDE], force = 0.0;
            int side = SIDE(s->contact[j]);
            if (s->contact[j])
                force = level[j] * x->d[side][j][k] + ADDED_DAMPING[j] * rates[side];
            for (int i = 0; i < N; i++)
                sum[i] -= LINE_INPUT[DRIVE_SIDE][j][i] * oil + LINE_INPUT[side][j][i] * force;
            if (k == 0) x->force[j] = oil + force;
        }
        for (int i = 0; i < N; i++) {
            x->q[k + 1][i] = v[i] * h / (k + 1);
            x->v[k + 1][i] = sum[i] * h / (k + 1);
        }
    }
}

/* Move the state to a fraction of the piece, whose length is h. */
static void advance(Instance *x, double fraction, double t) {
    for (int i = 0; i < N; i++) {
        double q = 0.0, v = 0.0;
        for (int k = x->degree + 1; k >= 0; k--)
            q = q * fraction + x->q[k][i], v = v * fraction + x->v[k][i];
        x->s.q[i] = q, x->s.v[i] = v;
    }
    x->s.t = t;
}

/* ---- First fall of a polynomial through zero ---- */

/* Split a polynomial of degree n: b becomes the right half, `left` is filled (de Casteljau). */
static void halve(double *b, double *left, int n) {
    for (int k = 0; k <= n; k++) {
        left[k] = b[0];
        for (int i = 0; i < n - k; i++) b[i] = 0.5 * (b[i] + b[i + 1]);
    }
}

/* Return the root on [0, 1] of a polynomial that changes once from plus to minus, and its slope. */
static double find_root(const double *b, int n, double s, double *slope) {
    double lower = 0.0, upper = 1.0, last_step = 0.0;
    for (int count = 0; count < MAX_NEWTON; count++) {
        double row[DEGREE + 1];
        memcpy(row, b, sizeof(double) * (size_t)(n + 1));
        for (int k = n; k > 1; k--)
            for (int i = 0; i < k; i++) row[i] += s * (row[i + 1] - row[i]);
        double value = row[0] + s * (row[1] - row[0]);
        *slope = n * (row[1] - row[0]);
        if (value > 0.0) lower = s;
        else upper = s;
        double next = *slope < 0.0 ? s - value / *slope : -1.0;
        bool newton = lower <= next && next <= upper && count % 8 < 7;
        if (!newton) next = 0.5 * (lower + upper);
        double step = fabs(next - s);
        s = next;
        if (step <= 2e-16 * upper) break;
        if (newton && step * step * step < 1e-17 * upper * last_step * last_step) break;
        last_step = newton ? step : 0.0;
    }
    return s;
}

/* Return the sign changes of the coefficients b, and an estimate of the last root. */
static int sign_changes(const double *b, int n, double tolerance, double *estimate) {
    int count = 0, last = 0;
    *estimate = 0.0;
    for (int i = 1; i <= n; i++) {
        if (fabs(b[i]) <= tolerance) continue;
        if (b[last] * b[i] < 0.0) {
            count++;
            *estimate = (last + (i - last) * b[last] / (b[last] - b[i])) / n;
        }
        last = i;
    }
    return count;
}

/* Return the first s in [0, end] where the polynomial in rows[0] falls through zero.

   It is 2 if there is none, -1 if the search takes too many intervals. The first `zeros` power
   coefficients are exactly 0. A dip below zero by `error` is rounding. */
static double first_fall(double rows[][DEGREE + 2], int n, int zeros, double end, double error,
                         double *root_error) {
    double *b = rows[0], tolerance = error, start = 0.0;
    int depth = 0, divided = 0, last = DEGREE + 1;
    *root_error = 0.0;
    if (!(error < INFINITY)) return 2.0;
    for (; divided < zeros && n > 2; divided++) { /* factors s are divided out */
        for (int i = 0; i < n; i++) b[i] = b[i + 1] * n / (i + 1);
        tolerance *= n--;
    }
    double slope = n * (b[1] - b[0]);
    if (zeros == 0 && b[0] <= 0.0 && slope < -tolerance) return 0.0;
    if (zeros > 0 && fabs(b[0]) <= tolerance && slope < -tolerance) return fmax(-b[0] / slope, 0.0);
    b[last] = 1.0;
    for (int count = 0; count < MAX_INTERVALS; count++) {
        if (depth < 0 || start > end) return 2.0;
        b = rows[depth];
        double width = b[last], smallest = b[0], largest = b[0], estimate;
        for (int i = 1; i <= n; i++) smallest = fmin(smallest, b[i]), largest = fmax(largest, b[i]);
        if (smallest >= -tolerance) {
            start += width, depth--;
            continue;
        }
        int changes = sign_changes(b, n, tolerance, &estimate);
        if (changes == 1 && b[0] > 0.0) {
            double root = start + width * find_root(b, n, estimate, &slope);
            if (root > end) return 2.0;
            slope *= pow(root, zeros) / width;
            if (slope != 0.0) *root_error = error / fabs(slope);
            return root;
        }
        if ((largest < 0.0 && b[n] >= b[0]) || (changes == 1 && b[n] > tolerance)) {
            start += width, depth--; /* it starts below zero and rises */
        } else if (depth == MAX_DEPTH) {
            if (b[n] < -tolerance && b[n] < b[0]) return start;
            start += width, depth--;
        } else { /* this row keeps the right half; the next one, the left half, comes first */
            halve(b, rows[depth + 1], n);
            b[last] = rows[depth + 1][last] = 0.5 * width;
            depth++;
        }
    }
    return depth < 0 ? 2.0 : -1.0;
}

/* Return the instant of the first event of all meshes in a piece, as `first_fall` does. */
static double find_events(Instance *x, double end) {
    const State *s = &x->s;
    double first = 2.0;
    int n = x->degree;
    for (int j = 0; j < M; j++) {
        x->instant[j] = 2.0;
        for (int line = 1; line >= -1; line -= 2) {
            int side = SIDE(line), code = s->contact[j];
            if (line == -1 && !HAS_COAST[j]) continue;
            if (code == -line && CONSTANT_GAP[j]) continue; /* both flanks never touch at once */
            double sign = (line == 1) == (code == line) ? 1.0 : -1.0, error = 0.0, others = 0.0;
            const double *d = x->d[side][j], *size = x->size[side][j];
            int zeros = s->line[j] == line ? s->order[j] : 0;
            for (int k = n; k >= 0; k--) error += ROUNDING * size[k];
            for (int k = 1; k <= n; k++) others += fabs(d[k]);
            if (zeros == 0 && s->order[j] < 2 && sign * d[0] > others + error) continue;
            for (int i = 0; i <= n; i++) { /* powers to Bernstein coefficients */
                double sum = 0.0;
                for (int k = i; k >= 0; k--)
                    if (k >= zeros) sum += d[k] * binomial[i][k] / binomial[n][k];
                x->rows[0][i] = sign * sum;
            }
            double instant, instant_error = 0.0;
            bool no_backlash = CONSTANT_GAP[j] && s->backlash[j] + GAP[j] == 0.0;
            if (zeros == 0 && s->order[j] > 1 && no_backlash
                && sign * d[s->order[j]] < -ROUNDING * size[s->order[j]])
                instant = 0.0; /* it falls from rest, without backlash between the flanks */
            else
                instant = first_fall(x->rows, n, zeros, end, error, &instant_error);
            if (instant < 0.0) return -1.0;
            if (instant < x->instant[j]) {
                x->instant[j] = instant, x->instant_error[j] = instant_error;
                x->after[j] = code == line ? 0 : code == -line ? 2 : line;
            }
        }
        first = fmin(first, x->instant[j]);
    }
    return first;
}

/* ---- Runs ---- */

static int sign_of(double value, double size) {
    return fabs(value) <= ZERO_SUM * size ? 0 : value > 0.0 ? 1 : -1;
}

/* Find intervals of stiffness and contacts for a state that was set; return 0 or JAMMED. */
static int find_contacts(Instance *x) {
    State *s = &x->s;
    bool undecided[M], any = false;
    set_rotation(s);
    if (s->phase_is_set) find_cells(s);
    s->phase_is_set = s->stale = 0;
    for (int j = 0; j < M; j++) s->pending[j] = s->contact[j] = s->order[j] = 0;
    x->degree = MAX_ORDER;
    double h = 1.0 / fastest_rate(s, 0.0);
    fill_series(x, h);
    for (int j = 0; j < M; j++) {
        int drive = sign_of(x->d[DRIVE_SIDE][j][0], x->size[DRIVE_SIDE][j][0]);
        int coast = sign_of(x->d[COAST_SIDE][j][0], x->size[COAST_SIDE][j][0]);
        if (!HAS_COAST[j]) coast = 1;
        if (drive >= 0 && x->d[COAST_SIDE][j][0] < -MAX_OVERLAP * x->size[COAST_SIDE][j][0]
            && HAS_COAST[j] && !CONSTANT_GAP[j]) return JAMMED;
        s->line[j] = drive == 0 ? 1 : drive < 0 && coast == 0 ? -1 : 0;
        s->contact[j] = drive > 0 ? 1 : drive < 0 && coast < 0 ? -1 : 0;
        any |= undecided[j] = s->line[j] != 0;
    }
    /* On a flank line the first derivative that is not zero decides. */
    for (int order = 1; any && order < MAX_ORDER; order++) {
        any = false;
        fill_series(x, h);
        for (int j = 0; j < M; j++) {
            int side = SIDE(s->line[j]);
            int sign = sign_of(x->d[side][j][order], x->size[side][j][order]);
            if (undecided[j] && sign) {
                undecided[j] = false, s->order[j] = order;
                if (sign == s->line[j]) s->contact[j] = sign;
            }
            any |= undecided[j];
        }
    }
    for (int j = 0; j < M; j++)
        if (undecided[j]) s->order[j] = MAX_ORDER, s->contact[j] = s->line[j] > 0;
    return 0;
}

/* Apply the changes of contact at the present instant; return 0 or JAMMED. */
static int change_contacts(State *s) {
    for (int j = 0; j < M; j++) {
        if (!s->pending[j]) continue;
        if (s->next_contact[j] == 2) return JAMMED;
        s->line[j] = s->contact[j] ? s->contact[j] : s->next_contact[j];
        s->contact[j] = s->next_contact[j];
        s->order[j] = 1, s->pending[j] = 0, s->events++;
    }
    return 0;
}

/* Run to the time `end`, or to the next contact event if `stop` is not NULL; return a failure. */
static int run(Instance *x, double end, bool *stop) {
    State *s = &x->s;
    int stalled = 0, failure = s->stale ? find_contacts(x) : change_contacts(s);
    set_rotation(s);
    while (!failure && s->t < end) {
        int mesh = 0, side = 0, step = 0;
        double to_switch = next_switch(s, &mesh, &side, &step);
        double h = fmin(to_switch, end - s->t), rate, power = 1.0;
        h = fmin(h, MAX_RATE_TIME / fastest_rate(s, 0.0));
        h = fmin(h, MAX_RATE_TIME / fastest_rate(s, h));
        double t = h == end - s->t ? end : s->t + h;
        bool switches = h == to_switch;
        if (t == s->t && switches) { /* the switch is here, or closer than rounding */
            s->cell[mesh][side] += step;
            continue;
        }
        h = t - s->t;
        rate = fastest_rate(s, h) * h, x->degree = 0;
        do power *= rate / ++x->degree;
        while (x->degree < DEGREE && (power > SERIES_END || x->degree < 4));
        for (int j = 0; j < M; j++)
            if (s->order[j] > 1) x->degree = DEGREE;
        fill_series(x, h);
        double instant = find_events(x, 1.0), error = 0.0;
        if (instant < 0.0) return UNRESOLVED;
        memset(s->order, 0, sizeof s->order);
        if (instant > 1.0) {
            advance(x, 1.0, t);
            if (switches) s->cell[mesh][side] += step;
            stalled = 0;
            continue;
        }
        double before = s->t;
        advance(x, instant, fmin(s->t + instant * h, end));
        stalled = s->t > before ? 0 : stalled + 1;
        for (int j = 0; j < M; j++)
            if (x->instant[j] == instant) error = fmax(error, x->instant_error[j]);
        for (int j = 0; j < M; j++) {
            double tolerance = fmin(8.0 * (error + x->instant_error[j]), SAME_INSTANT);
            s->pending[j] = x->instant[j] <= 1.0 && x->instant[j] - instant <= tolerance;
            s->next_contact[j] = x->after[j];
        }
        if (stop) return *stop = true, 0; /* Event Mode applies the changes */
        failure = stalled > MAX_STALLED ? STALLED : change_contacts(s);
    }
    for (int i = 0; i < N; i++)
        if (!(fabs(s->q[i]) < 1e150)) failure = failure ? failure : OVERFLOWED;
    return failure;
}

/* ---- Values of variables ---- */

enum { /* first value reference of each kind */
    VR_PHASE = 1, VR_RATE, VR_SPEED_INPUT, VR_EVENTS, VR_Q, VR_V = VR_Q + N, VR_TORQUE = VR_V + N,
    VR_BACKLASH = VR_TORQUE + B, VR_ANGLE = VR_BACKLASH + M, VR_SPEED = VR_ANGLE + B,
    VR_DISPLACEMENT = VR_SPEED + B, VR_FORCE = VR_DISPLACEMENT + M, VR_CONTACT = VR_FORCE + M,
    VR_BEARING = VR_CONTACT + M, VR_END = VR_BEARING + R
};

static double product(const double *row, const double *vector) {
    double sum = 0.0;
    for (int i = 0; i < N; i++) sum += row[i] * vector[i];
    return sum;
}

/* Let x->d, x->force and x->v[1], the accelerations, belong to the present state. */
static void evaluate(Instance *x) {
    set_rotation(&x->s);
    x->degree = 1;
    fill_series(x, 1.0);
}

static bool get_value(Instance *x, uint32_t vr, double *value) {
    State *s = &x->s;
    int i = (int)vr, b = i - VR_ANGLE, j = i - VR_FORCE;
    double phase = phase_at(s, s->t), rate = rate_at(s, s->t);
    if (vr >= VR_END || vr == VR_EVENTS || (vr >= VR_CONTACT && vr < VR_BEARING)) return false;
    double first[] = {s->t, phase, rate, s->speed};
    if (vr < VR_EVENTS) *value = first[vr];
    else if (vr < VR_V) *value = s->q[i - VR_Q];
    else if (vr < VR_TORQUE) *value = s->v[i - VR_V];
    else if (vr < VR_BACKLASH) *value = torque_on(s, i - VR_TORQUE);
    else if (vr < VR_ANGLE) *value = s->backlash[i - VR_BACKLASH];
    else if (vr < VR_SPEED) *value = BODY_RATE[b] * phase + product(ROTATION[b], s->q);
    else if (vr < VR_DISPLACEMENT)
        *value = BODY_RATE[b - B] * rate + product(ROTATION[b - B], s->v);
    else if (vr < VR_FORCE) *value = x->d[DRIVE_SIDE][i - VR_DISPLACEMENT][0];
    else if (vr < VR_CONTACT) {
        int side = SIDE(s->contact[j]);
        *value = s->contact[j] ? stiffness_of(s, j, side) * x->d[side][j][0] : 0.0;
    } else {
        const double *row = BEARING[i - VR_BEARING];
        *value = product(row, s->q) + product(row + N, s->v) + product(row + 2 * N, x->v[1]);
        for (j = 0; j < M; j++) *value += row[3 * N + j] * x->force[j];
        *value += row[3 * N + M] * s->acceleration;
    }
    return true;
}

static bool set_value(Instance *x, uint32_t vr, double value) {
    State *s = &x->s;
    int i = (int)vr;
    if (!isfinite(value)) return false;
    if (vr == VR_PHASE || (vr == VR_RATE && !PRESCRIBED)) {
        double phase = phase_at(s, s->t), rate = rate_at(s, s->t);
        s->t0 = s->t, s->phase0 = vr == VR_PHASE ? value : phase;
        s->rate0 = vr == VR_RATE ? value : rate;
        s->stale = s->phase_is_set = 1;
    } else if (vr == VR_SPEED_INPUT && PRESCRIBED) s->speed = value;
    else if (vr >= VR_Q && vr < VR_V) s->q[i - VR_Q] = value, s->stale = 1;
    else if (vr >= VR_V && vr < VR_TORQUE) s->v[i - VR_V] = value, s->stale = 1;
    else if (vr >= VR_TORQUE && vr < VR_BACKLASH && i - VR_TORQUE != DRIVER)
        s->torque[i - VR_TORQUE] = value;
    else if (vr >= VR_BACKLASH && vr < VR_ANGLE && value >= 0.0 && HAS_COAST[i - VR_BACKLASH]) {
        if (value != s->backlash[i - VR_BACKLASH]) s->stale = 1;
        s->backlash[i - VR_BACKLASH] = value;
    } else return false;
    return true;
}

static void start(State *s) {
    memset(s, 0, sizeof *s);
    s->rate0 = START_RATE, s->speed = START_RATE * PINION_RATE;
    memcpy(s->q, START_Q, sizeof s->q);
    memcpy(s->torque, START_TORQUE, sizeof s->torque);
    memcpy(s->backlash, START_BACKLASH, sizeof s->backlash);
    s->stale = s->phase_is_set = 1;
}

/* ---- Interface of FMI 3.0: the declarations of the standard that it needs ---- */

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
#ifndef FMI3_FUNCTION_PREFIX /* given where several FMUs are linked into one program */
#define FMI3_FUNCTION_PREFIX
#endif
#define JOIN(a, b) a##b
#define PREFIXED(prefix, name) JOIN(prefix, name)
#define FMI(name) PREFIXED(FMI3_FUNCTION_PREFIX, name)

#define FUNCTION(name) EXPORT Status FMI(fmi3##name)
#define REFS const Reference r[], size_t n /* value references */

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;
typedef uint32_t Reference;
typedef void (*Logger)(void *, int, const char *, const char *);

static Status say(Instance *x, Status status, const char *format, ...) {
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (x->log && (x->logging || status >= ERROR))
        x->log(x->environment, status, "logStatus", text);
    return status;
}

static Status failed(Instance *x, int failure) {
    const char *reasons[] = {
        "", "both flanks of a mesh touch, which the model does not describe",
        "rounding hides whether flanks touch", "contact changes without end at one instant",
        "the motion grows beyond all bounds"};
    if (!failure) return OK;
    return say(x, ERROR, "At t = %.9g s %s.", x->s.t, reasons[failure]);
}

EXPORT const char *FMI(fmi3GetVersion)(void) { return "3.0"; }

FUNCTION(SetDebugLogging)(void *x, bool on, size_t n, const char *const categories[]) {
    return ((Instance *)x)->logging = on, OK;
}

EXPORT void *FMI(fmi3InstantiateCoSimulation)(
    const char *name, const char *token, const char *resources, bool visible, bool logging,
    bool event_mode, bool early_return, const Reference required[], size_t n, void *environment,
    Logger log, void (*update)(void)) {
    if (!token || strcmp(token, TOKEN)) {
        if (log) log(environment, ERROR, "logStatus", "The token is that of another FMU.");
        return NULL;
    }
    Instance *x = calloc(1, sizeof *x);
    if (!x) return NULL;
    x->environment = environment, x->log = log, x->logging = logging;
    x->event_mode = event_mode, x->early_return = early_return;
    fill_binomials();
    start(&x->s);
    return x;
}

#define OTHER_KIND(name, ...)                                                                 \
    EXPORT void *FMI(name)(const char *a, const char *b, const char *c, bool d, bool e,       \
                           __VA_ARGS__) {                                                     \
        if (log) log(environment, ERROR, "logStatus", "This FMU is for Co-Simulation only."); \
        return NULL;                                                                          \
    }
OTHER_KIND(fmi3InstantiateModelExchange, void *environment, Logger log)
OTHER_KIND(fmi3InstantiateScheduledExecution, void *environment, Logger log, void (*update)(void),
           void (*lock)(void), void (*unlock)(void))

EXPORT void FMI(fmi3FreeInstance)(void *x) { free(x); }
FUNCTION(Reset)(void *x) { return start(&((Instance *)x)->s), OK; }

FUNCTION(EnterInitializationMode)(void *instance, bool with_tolerance, double tolerance, double t,
                                  bool with_stop, double stop) {
    State *s = &((Instance *)instance)->s;
    return s->t = s->t0 = t, OK;
}

/* Return whether there are contacts for a state that was set. */
static Status settle(Instance *x) { return failed(x, x->s.stale ? find_contacts(x) : 0); }

FUNCTION(ExitInitializationMode)(void *x) { return settle(x); }

FUNCTION(UpdateDiscreteStates)(void *x, bool *again, bool *terminate, bool *nominals, bool *values,
                               bool *has_next_event, double *next_event) {
    *again = *terminate = *nominals = *values = *has_next_event = false, *next_event = 0.0;
    return failed(x, change_contacts(&((Instance *)x)->s));
}

FUNCTION(DoStep)(void *instance, double t, double step, bool no_set, bool *event, bool *terminate,
                 bool *early, double *last_time) {
    Instance *x = instance;
    bool stop = false;
    *event = *terminate = *early = false, *last_time = x->s.t;
    if (!(step > 0.0) || fabs(t - x->s.t) > 1e-9 * (fabs(t) + step))
        return say(x, ERROR, "A step of %.9g s from t = %.9g s is not allowed: it must be > 0, "
                   "from t = %.9g s.", step, t, x->s.t);
    Status status = failed(x, run(x, t + step, x->event_mode && x->early_return ? &stop : NULL));
    *event = stop, *early = stop && x->s.t < t + step;
    *last_time = x->s.t;
    return status;
}

FUNCTION(GetFloat64)(void *instance, REFS, double values[], size_t count) {
    Instance *x = instance;
    Status status = settle(x);
    evaluate(x);
    for (size_t i = 0; i < n && i < count && !status; i++)
        if (!get_value(x, r[i], &values[i]))
            status = say(x, ERROR, "Value reference %u is not that of a Float64.", (unsigned)r[i]);
    return status;
}

FUNCTION(SetFloat64)(void *instance, REFS, const double values[], size_t count) {
    Instance *x = instance;
    for (size_t i = 0; i < n && i < count; i++)
        if (!set_value(x, r[i], values[i]))
            return say(x, ERROR, "%.9g is not allowed for value reference %u: it must be finite, a "
                       "backlash >= 0, of a variable that can be set.", values[i], (unsigned)r[i]);
    return OK;
}

FUNCTION(GetInt32)(void *instance, REFS, int32_t values[], size_t count) {
    Instance *x = instance;
    Status status = settle(x);
    for (size_t i = 0; i < n && i < count && !status; i++)
        if (r[i] == VR_EVENTS) values[i] = x->s.events;
        else if (r[i] >= VR_CONTACT && r[i] < VR_BEARING)
            values[i] = x->s.contact[r[i] - VR_CONTACT];
        else status = say(x, ERROR, "Value reference %u is not that of an Int32.", (unsigned)r[i]);
    return status;
}

/* States: copied, freed, and as bytes behind the token of the FMU. */

static Status copy_state(void *x, void **copy, const void *state) {
    if (!*copy) *copy = malloc(sizeof(State));
    if (!*copy) return say(x, ERROR, "There is no memory for a state.");
    return memcpy(*copy, state, sizeof(State)), OK;
}

FUNCTION(GetFMUState)(void *x, void **copy) { return copy_state(x, copy, &((Instance *)x)->s); }
FUNCTION(SetFMUState)(void *x, void *copy) { return ((Instance *)x)->s = *(State *)copy, OK; }
FUNCTION(FreeFMUState)(void *x, void **copy) { return free(*copy), *copy = NULL, OK; }

FUNCTION(SerializedFMUStateSize)(void *x, void *copy, size_t *size) {
    return *size = sizeof TOKEN + sizeof(State), OK;
}

FUNCTION(SerializeFMUState)(void *x, void *copy, uint8_t bytes[], size_t size) {
    if (size < sizeof TOKEN + sizeof(State)) return say(x, ERROR, "The state needs more bytes.");
    memcpy(bytes, TOKEN, sizeof TOKEN);
    memcpy(bytes + sizeof TOKEN, copy, sizeof(State));
    return OK;
}

FUNCTION(DeserializeFMUState)(void *x, const uint8_t bytes[], size_t size, void **copy) {
    if (size != sizeof TOKEN + sizeof(State) || memcmp(bytes, TOKEN, sizeof TOKEN))
        return say(x, ERROR, "The bytes are not those of a state of this FMU.");
    return copy_state(x, copy, bytes + sizeof TOKEN);
}

/* Changes of mode without an effect. */
#define MODE(name) FUNCTION(name)(void *x) { return OK; }
MODE(EnterEventMode) MODE(EnterStepMode) MODE(EvaluateDiscreteStates) MODE(Terminate)
MODE(EnterConfigurationMode) MODE(ExitConfigurationMode)

/* Functions of which this FMU has no variables, or that belong to other kinds of FMUs. */
#define ABSENT(name, ...)                                          \
    FUNCTION(name)(void *x, __VA_ARGS__) {                \
        return say(x, ERROR, #name " is not allowed in this FMU"); \
    }
#define VALUES(name, c)                                                   \
    FUNCTION(name)(void *x, REFS, c v[], size_t m) {             \
        return n ? say(x, ERROR, #name ": there is no such variable") : OK; \
    }
#define NO_VARIABLES(type, c) VALUES(Get##type, c) VALUES(Set##type, const c)
typedef const char *Text;
NO_VARIABLES(Float32, float) NO_VARIABLES(Int8, int8_t)
NO_VARIABLES(UInt8, uint8_t) NO_VARIABLES(Int16, int16_t)
NO_VARIABLES(UInt16, uint16_t) VALUES(SetInt32, const int32_t) NO_VARIABLES(UInt32, uint32_t)
NO_VARIABLES(Int64, int64_t) NO_VARIABLES(UInt64, uint64_t)
NO_VARIABLES(Boolean, bool) NO_VARIABLES(String, Text)
ABSENT(GetBinary, REFS, size_t sizes[], const uint8_t *v[], size_t m)
ABSENT(SetBinary, REFS, const size_t sizes[], const uint8_t *const v[], size_t m)
ABSENT(GetClock, REFS, bool v[]) ABSENT(SetClock, REFS, const bool v[])
ABSENT(GetNumberOfVariableDependencies, Reference r, size_t *n)
ABSENT(GetVariableDependencies, Reference r, size_t a[], Reference b[], size_t c[], int d[],
       size_t n)
#define SEEDED REFS, const Reference q[], size_t m, const double s[], size_t k, double v[], size_t l
ABSENT(GetDirectionalDerivative, SEEDED) ABSENT(GetAdjointDerivative, SEEDED)
ABSENT(GetOutputDerivatives, REFS, const int32_t orders[], double v[], size_t m)
ABSENT(GetIntervalDecimal, REFS, double v[], int q[])
ABSENT(GetIntervalFraction, REFS, uint64_t c[], uint64_t f[], int q[])
ABSENT(GetShiftDecimal, REFS, double v[])
ABSENT(GetShiftFraction, REFS, uint64_t c[], uint64_t f[])
ABSENT(SetIntervalDecimal, REFS, const double v[])
ABSENT(SetIntervalFraction, REFS, const uint64_t c[], const uint64_t f[])
ABSENT(SetShiftDecimal, REFS, const double v[])
ABSENT(SetShiftFraction, REFS, const uint64_t c[], const uint64_t f[])
ABSENT(CompletedIntegratorStep, bool no_return, bool *event, bool *terminate)
ABSENT(SetTime, double t)
FUNCTION(EnterContinuousTimeMode)(void *x) { return say(x, ERROR, "not allowed"); }
ABSENT(SetContinuousStates, const double v[], size_t n)
ABSENT(GetContinuousStateDerivatives, double v[], size_t n)
ABSENT(GetEventIndicators, double v[], size_t n)
ABSENT(GetContinuousStates, double v[], size_t n)
ABSENT(GetNominalsOfContinuousStates, double v[], size_t n)
ABSENT(GetNumberOfEventIndicators, size_t *n) ABSENT(GetNumberOfContinuousStates, size_t *n)
ABSENT(ActivateModelPartition, Reference clock, double t)
