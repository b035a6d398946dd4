/* Energies of states of Kepler's problem, up to rounding errors of long double (x86: 64 bits of mantissa).

   What a method does to energy is periodic along its orbits, and far larger than what rounding does. So the energy of a
   state is taken as its mean over the steps that follow, made in long double: an invariant of the map, since its orbits
   are quasi-periodic and the weights, a Gaussian of 17 standard deviations, damp every period below 1e-16. */
#include <math.h>

#include "precise_coefficients.h"

#define WIDTH 280   /* steps in a standard deviation: 1.4 periods of 200 steps */
#define WINDOW 8.5L /* standard deviations on either side */
#define MAX_ITERATIONS 100

typedef long double real;
typedef struct {
    real v[2], q[2];
} point;

static void acceleration(const real *q, real *a)
{
    real r2 = q[0] * q[0] + q[1] * q[1], w = -1 / (r2 * sqrtl(r2));
    a[0] = w * q[0];
    a[1] = w * q[1];
}

static real energy(const point *x)
{
    return (x->v[0] * x->v[0] + x->v[1] * x->v[1]) / 2 - 1 / hypotl(x->q[0], x->q[1]);
}

static void stormer_verlet_kdk(point *x, real h)
{
    real a[2];
    acceleration(x->q, a);
    for (int k = 0; k < 2; k++) {
        x->v[k] += h / 2 * a[k];
        x->q[k] += h * x->v[k];
    }
    acceleration(x->q, a);
    for (int k = 0; k < 2; k++)
        x->v[k] += h / 2 * a[k];
}

/* In the accelerations of the stages, as gauss.h says. Fixed-point iteration until nothing changes any more, or changes
   fall no more. */
static void gauss3(point *x, real h)
{
    real g[3][2], new[3][2], last = INFINITY;
    for (int i = 0; i < 3; i++)
        acceleration(x->q, g[i]);
    for (int m = 1; m <= MAX_ITERATIONS; m++) {
        real change = 0;
        for (int i = 0; i < 3; i++) {
            real at[2];
            for (int k = 0; k < 2; k++) {
                real sum = 0;
                for (int j = 0; j < 3; j++)
                    sum += gauss3_A2[3 * i + j] * g[j][k];
                at[k] = x->q[k] + h * (gauss3_c[i] * x->v[k] + h * sum);
            }
            acceleration(at, new[i]);
        }
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 2; k++) {
                change = fmaxl(change, fabsl(new[i][k] - g[i][k]));
                g[i][k] = new[i][k];
            }
        if (change == 0 || (m > 2 && change >= last))
            break;
        last = change;
    }
    for (int k = 0; k < 2; k++) {
        real dv = 0, dq = 0;
        for (int i = 0; i < 3; i++) {
            dv += gauss3_b[i] * g[i][k];
            dq += gauss3_bA[i] * g[i][k];
        }
        x->q[k] += h * (x->v[k] + h * dq);
        x->v[k] += h * dv;
    }
}

static real mean_energy(void (*step)(point *, real), point x, real h)
{
    real sum = 0, weights = 0;
    for (int n = -WINDOW * WIDTH; n <= WINDOW * WIDTH; n++) {
        real t = (real)n / WIDTH, weight = expl(-t * t / 2);
        sum += weight * energy(&x);
        weights += weight;
        step(&x, h);
    }
    return sum / weights;
}

/* For each state its energy over that of the first, less 1. A row: p and q, then what is to be added to them. */
static void energy_changes(void (*step)(point *, real), const double *rows, long count, double h, double *changes)
{
    real start = 0;
    for (long n = 0; n < count; n++) {
        const double *y = rows + 8 * n;
        point x;
        for (int k = 0; k < 2; k++) {
            x.v[k] = (real)y[k] + y[4 + k];
            x.q[k] = (real)y[2 + k] + y[6 + k];
        }
        real mean = mean_energy(step, x, h);
        if (n == 0)
            start = mean;
        changes[n] = (mean - start) / fabsl(start);
    }
}

void energy_changes_stormer_verlet_kdk(const double *rows, long count, double h, double *changes)
{
    energy_changes(stormer_verlet_kdk, rows, count, h, changes);
}

void energy_changes_gauss3(const double *rows, long count, double h, double *changes)
{
    energy_changes(gauss3, rows, count, h, changes);
}
