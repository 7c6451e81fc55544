/* The one-hour closed-loop mission by hand: the yardstick of the benchmark.
 *
 * Plant: dynamics.py for a linear drag, no leakage, no dry friction. RK4, SUBSTEPS a sample, all
 * written out. End stops, bottom and surface are selects:
 *   - the volume that the water feels is clamped in every stage, so a hit inside a substep costs
 *     no order; after the substep V stands at the stop and q = 0;
 *   - a vehicle that starts a substep on the bottom cannot accelerate downwards in any stage;
 *     one that has gone through it is put back on it with w = 0;
 *   - below the surface the stiffness of the emerging hull is the larger of two straight lines.
 * Law: the paper's cascade (eqs 36-37), the voltage limited by the supply.
 *
 * `ensemble_exact` is the same with another algorithm: where nothing can be touched within a sample
 * the motion is linear, and one product with the exponential of its matrix is exact; a block in
 * which a vehicle comes near a stop, the surface or the bottom takes that sample with RK4.
 *
 * Build: cc -O3 -march=native -ffast-math -DLANES=16 -mprefer-vector-width=512 -shared -fPIC
 */
#include <stddef.h>

#ifndef LANES
#define LANES 16 /* vehicles that advance side by side; their state stays in the first cache */
#endif
#define SUBSTEPS 3

enum { T1, GAIN, LOAD, V_MIN, V_MAX, SUPPLY, A_B, PSI, V_0, D_L, Z_SURFACE, A_S, Z_BOTTOM, Q, V, Z, W, FIELDS };
enum { END_Q, END_V, END_Z, END_W, SHALLOWEST, DEEPEST, SQUARES, RESULTS };

typedef struct {
    double k_pV, k_pz, k_iz, k_dz, S_p;
} cascade;

typedef struct {
    double drive, load, rate;      /* dq = drive - load z - rate q */
    double v_min, v_max, a_b, d_l; /* dw = pull - a_b V - d_l w */
    double wet, wet_0, dry, dry_0; /* pull: the larger of wet z + wet_0 and dry z + dry_0 */
    double bottom, ceiling;        /* ceiling: 0 on the bottom, else out of reach */
} plant;

typedef struct {
    double q, v, z, w;
} state;

static inline double least(double a, double b) { return a < b ? a : b; }
static inline double most(double a, double b) { return a > b ? a : b; }

static inline double inside(double v, const plant p)
{
    return least(most(v, p.v_min), p.v_max);
}

static inline state rates(state x, double v, const plant p)
{
    const double pull = most(p.wet * x.z + p.wet_0, p.dry * x.z + p.dry_0);
    return (state){p.drive - p.load * x.z - p.rate * x.q, x.q, x.w,
                   least(pull - p.a_b * v - p.d_l * x.w, p.ceiling)};
}

static inline state along(state x, double h, state d)
{
    return (state){x.q + h * d.q, x.v + h * d.v, x.z + h * d.z, x.w + h * d.w};
}

static inline state substep(state x, double h, plant p)
{
    p.ceiling = x.z >= p.bottom ? 0.0 : 1e30;
    const state k1 = rates(x, x.v, p);
    const state x2 = along(x, 0.5 * h, k1), k2 = rates(x2, inside(x2.v, p), p);
    const state x3 = along(x, 0.5 * h, k2), k3 = rates(x3, inside(x3.v, p), p);
    const state x4 = along(x, h, k3), k4 = rates(x4, inside(x4.v, p), p);
    x.q += h / 6.0 * (k1.q + 2.0 * (k2.q + k3.q) + k4.q);
    x.v += h / 6.0 * (k1.v + 2.0 * (k2.v + k3.v) + k4.v);
    x.z += h / 6.0 * (k1.z + 2.0 * (k2.z + k3.z) + k4.z);
    x.w += h / 6.0 * (k1.w + 2.0 * (k2.w + k3.w) + k4.w);
    x.q = x.v > p.v_max ? least(x.q, 0.0) : x.q;
    x.q = x.v < p.v_min ? most(x.q, 0.0) : x.q;
    x.v = inside(x.v, p);
    x.w = x.z > p.bottom ? least(x.w, 0.0) : x.w;
    x.z = least(x.z, p.bottom);
    return x;
}

static inline double volts(double reference, state x, double *integral, double *error,
                           double supply, const cascade *c)
{
    const double e = reference - x.z;
    const double u = c->k_pz * e + c->k_dz / c->S_p * (e - *error) + *integral;
    *integral += c->k_iz * c->S_p * e;
    *error = e;
    return least(most(c->k_pV * (u - x.v), -supply), supply);
}

static inline plant prepared(const double *f, ptrdiff_t stride)
{
    const double wet = f[A_B * stride] * f[PSI * stride], wet_0 = f[A_B * stride] * f[V_0 * stride];
    return (plant){.load = f[GAIN * stride] * f[LOAD * stride] / f[T1 * stride],
                   .rate = 1.0 / f[T1 * stride],
                   .v_min = f[V_MIN * stride],
                   .v_max = f[V_MAX * stride],
                   .a_b = f[A_B * stride],
                   .d_l = f[D_L * stride],
                   .wet = wet,
                   .wet_0 = wet_0,
                   .dry = wet - f[A_S * stride],
                   .dry_0 = wet_0 + f[A_S * stride] * f[Z_SURFACE * stride],
                   .bottom = f[Z_BOTTOM * stride]};
}

/* One vehicle; trajectory: rows q, V, z, w, u of samples + 1 instants. */
void single(ptrdiff_t samples, const double *restrict reference, const cascade *restrict c,
            const double *restrict fields, double *restrict trajectory)
{
    const double h = c->S_p / SUBSTEPS;
    plant p = prepared(fields, 1);
    state x = {fields[Q], fields[V], fields[Z], fields[W]};
    double integral = x.v, error = reference[0] - x.z;
    for (ptrdiff_t k = 0; k <= samples; k++) {
        const double u = volts(reference[k], x, &integral, &error, fields[SUPPLY], c);
        double *restrict row = trajectory + k;
        row[0] = x.q;
        row[samples + 1] = x.v;
        row[2 * (samples + 1)] = x.z;
        row[3 * (samples + 1)] = x.w;
        row[4 * (samples + 1)] = u;
        p.drive = fields[GAIN] / fields[T1] * u;
        for (int s = 0; s < SUBSTEPS; s++)
            x = substep(x, h, p);
    }
}

/* A block of vehicles: parameters, state and summary, each a row of LANES numbers. */
typedef struct {
    double load[LANES], rate[LANES], v_min[LANES], v_max[LANES], a_b[LANES], d_l[LANES];
    double wet[LANES], wet_0[LANES], dry[LANES], dry_0[LANES], bottom[LANES];
    double supply[LANES], per_volt[LANES];
    double q[LANES], v[LANES], z[LANES], w[LANES], u[LANES], integral[LANES], error[LANES];
    double shallowest[LANES], deepest[LANES], squares[LANES];
} block;

static inline plant of(const block *b, int l, double u)
{
    return (plant){b->per_volt[l] * u, b->load[l], b->rate[l], b->v_min[l], b->v_max[l],
                   b->a_b[l], b->d_l[l], b->wet[l], b->wet_0[l], b->dry[l], b->dry_0[l],
                   b->bottom[l], 0.0};
}

static inline void begin(block *b, const double *fields, ptrdiff_t stride, double reference)
{
    for (int l = 0; l < LANES; l++) {
        const double *f = fields + l;
        const plant p = prepared(f, stride);
        b->load[l] = p.load, b->rate[l] = p.rate, b->v_min[l] = p.v_min, b->v_max[l] = p.v_max;
        b->a_b[l] = p.a_b, b->d_l[l] = p.d_l, b->wet[l] = p.wet, b->wet_0[l] = p.wet_0;
        b->dry[l] = p.dry, b->dry_0[l] = p.dry_0, b->bottom[l] = p.bottom;
        b->supply[l] = f[SUPPLY * stride];
        b->per_volt[l] = f[GAIN * stride] / f[T1 * stride];
        b->q[l] = f[Q * stride], b->v[l] = f[V * stride], b->z[l] = f[Z * stride];
        b->w[l] = f[W * stride], b->integral[l] = b->v[l], b->error[l] = reference - b->z[l];
        b->shallowest[l] = b->deepest[l] = b->z[l], b->squares[l] = 0.0;
    }
}

static inline void keep(const block *b, double *restrict depths)
{
    if (depths)
        for (int l = 0; l < LANES; l++)
            depths[l] = b->z[l];
}

static inline void enter(block *b, int l, state x, double target)
{
    b->q[l] = x.q, b->v[l] = x.v, b->z[l] = x.z, b->w[l] = x.w;
    b->shallowest[l] = least(b->shallowest[l], x.z), b->deepest[l] = most(b->deepest[l], x.z);
    b->squares[l] += (x.z - target) * (x.z - target);
}

static inline void end(const block *b, double *results, ptrdiff_t stride)
{
    for (int l = 0; l < LANES; l++) {
        double *r = results + l;
        r[END_Q * stride] = b->q[l], r[END_V * stride] = b->v[l], r[END_Z * stride] = b->z[l];
        r[END_W * stride] = b->w[l], r[SHALLOWEST * stride] = b->shallowest[l];
        r[DEEPEST * stride] = b->deepest[l], r[SQUARES * stride] = b->squares[l];
    }
}

/* Many vehicles: fields[FIELDS][stride], results[RESULTS][stride], of which lanes first..last - 1
 * are advanced; first and last are multiples of LANES. depths[samples + 1][stride], or NULL. */
void ensemble(ptrdiff_t first, ptrdiff_t last, ptrdiff_t stride, ptrdiff_t samples,
              const double *restrict reference, const cascade *restrict c,
              const double *restrict fields, double *restrict results, double *restrict depths)
{
    const double h = c->S_p / SUBSTEPS;
    const cascade law = *c;
    for (ptrdiff_t base = first; base < last; base += LANES) {
        block b;
        begin(&b, fields + base, stride, reference[0]);
        for (ptrdiff_t k = 0; k < samples; k++) {
            const double target = reference[k];
            keep(&b, depths ? depths + k * stride + base : NULL);
#pragma GCC ivdep
            for (int l = 0; l < LANES; l++) {
                state x = {b.q[l], b.v[l], b.z[l], b.w[l]};
                const plant p = of(&b, l, volts(target, x, &b.integral[l], &b.error[l], b.supply[l], &law));
                x = substep(x, h, p);
                x = substep(x, h, p);
                x = substep(x, h, p);
                enter(&b, l, x, target);
            }
        }
        keep(&b, depths ? depths + samples * stride + base : NULL);
        end(&b, results + base, stride);
    }
}

enum { N = 6 }; /* q, V, z, w, u, 1 */

static void product(const double a[N][N], const double b[N][N], double out[N][N])
{
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            double sum = 0.0;
            for (int k = 0; k < N; k++)
                sum += a[i][k] * b[k][j];
            out[i][j] = sum;
        }
}

/* exp(M h) of the motion in open water: Taylor series of M h/2^12, squared twelve times. */
static void transition(const plant p, double per_volt, double h, double out[N][N])
{
    enum { HALVINGS = 12, TERMS = 10 };
    double m[N][N] = {{-p.rate, 0.0, -p.load, 0.0, per_volt, 0.0},
                      {1.0},
                      {0.0, 0.0, 0.0, 1.0},
                      {0.0, -p.a_b, p.wet, -p.d_l, 0.0, p.wet_0}};
    double term[N][N] = {{0.0}}, next[N][N];
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            m[i][j] *= h / (1 << HALVINGS);
            out[i][j] = term[i][j] = i == j;
        }
    for (int n = 1; n <= TERMS; n++) {
        product(m, term, next);
        for (int i = 0; i < N; i++)
            for (int j = 0; j < N; j++)
                out[i][j] += term[i][j] = next[i][j] / n;
    }
    for (int n = 0; n < HALVINGS; n++) {
        product(out, out, next);
        for (int i = 0; i < N; i++)
            for (int j = 0; j < N; j++)
                out[i][j] = next[i][j];
    }
}

#define NEAR_Z 2e-3 /* m, m3: more than a sample can go and come back */
#define NEAR_V 8e-6

void ensemble_exact(ptrdiff_t first, ptrdiff_t last, ptrdiff_t stride, ptrdiff_t samples,
                    const double *restrict reference, const cascade *restrict c,
                    const double *restrict fields, double *restrict results,
                    double *restrict depths)
{
    const double h = c->S_p / SUBSTEPS;
    const cascade law = *c;
    for (ptrdiff_t base = first; base < last; base += LANES) {
        block b;
        double e[4][N][LANES], top[LANES], floor[LANES], in[LANES], out[LANES];
        double q[LANES], v[LANES], z[LANES], w[LANES];
        begin(&b, fields + base, stride, reference[0]);
        for (int l = 0; l < LANES; l++) {
            double m[N][N];
            transition(of(&b, l, 0.0), b.per_volt[l], c->S_p, m);
            for (int i = 0; i < 4; i++)
                for (int j = 0; j < N; j++)
                    e[i][j][l] = m[i][j];
            top[l] = fields[Z_SURFACE * stride + base + l] + NEAR_Z, floor[l] = b.bottom[l] - NEAR_Z;
            in[l] = b.v_min[l] + NEAR_V, out[l] = b.v_max[l] - NEAR_V;
        }
        for (ptrdiff_t k = 0; k < samples; k++) {
            const double target = reference[k];
            double beyond = -1.0; /* above 0: a vehicle may touch something */
            keep(&b, depths ? depths + k * stride + base : NULL);
#pragma GCC ivdep
            for (int l = 0; l < LANES; l++) {
                const state x = {b.q[l], b.v[l], b.z[l], b.w[l]};
                const double u = volts(target, x, &b.integral[l], &b.error[l], b.supply[l], &law);
                b.u[l] = u;
                q[l] = e[0][0][l] * x.q + e[0][1][l] * x.v + e[0][2][l] * x.z + e[0][3][l] * x.w + e[0][4][l] * u + e[0][5][l];
                v[l] = e[1][0][l] * x.q + e[1][1][l] * x.v + e[1][2][l] * x.z + e[1][3][l] * x.w + e[1][4][l] * u + e[1][5][l];
                z[l] = e[2][0][l] * x.q + e[2][1][l] * x.v + e[2][2][l] * x.z + e[2][3][l] * x.w + e[2][4][l] * u + e[2][5][l];
                w[l] = e[3][0][l] * x.q + e[3][1][l] * x.v + e[3][2][l] * x.z + e[3][3][l] * x.w + e[3][4][l] * u + e[3][5][l];
                beyond = most(beyond, most(most(v[l], x.v) - out[l], in[l] - least(v[l], x.v)));
                beyond = most(beyond, most(most(z[l], x.z) - floor[l], top[l] - least(z[l], x.z)));
            }
            if (beyond > 0.0) {
#pragma GCC ivdep
                for (int l = 0; l < LANES; l++) {
                    state x = {b.q[l], b.v[l], b.z[l], b.w[l]};
                    const plant p = of(&b, l, b.u[l]);
                    x = substep(x, h, p);
                    x = substep(x, h, p);
                    x = substep(x, h, p);
                    q[l] = x.q, v[l] = x.v, z[l] = x.z, w[l] = x.w;
                }
            }
#pragma GCC ivdep
            for (int l = 0; l < LANES; l++)
                enter(&b, l, (state){q[l], v[l], z[l], w[l]}, target);
        }
        keep(&b, depths ? depths + samples * stride + base : NULL);
        end(&b, results + base, stride);
    }
}
