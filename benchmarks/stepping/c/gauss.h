/* Gauss methods in the unknowns g_i = acceleration(q_i) (Nystrom form), with A2 = A A:

     q_i = q + h (c_i v + h sum_j A2_ij g_j),   v += h sum_i b_i g_i,   q += h (v + h sum_i (bA)_i g_i).

   Fixed-point iteration, from the polynomial through the last step's g_i, until the largest change of a g is zero, or
   falls no more after two iterations. Called with constants only, so that every loop is specialised. */

#define MAX_GAUSS 4
#define MAX_ITERATIONS 100

static ALWAYS_INLINE void combine(int s, const double *restrict matrix, double g[][DOF], double result[][DOF])
{
    for (int i = 0; i < s; i++)
        for (int k = 0; k < DOF; k++) {
            double sum = 0;
            for (int j = 0; j < s; j++)
                sum += matrix[i * s + j] * g[j][k];
            result[i][k] = sum;
        }
}

/* The largest change, with g replaced. Sizes of doubles are ordered as the integers of their bits (and a NaN is above
   them all): that maximum gcc does several at a time. */
static ALWAYS_INLINE double replace(int s, double g[][DOF], double new[][DOF])
{
    long long largest = 0;
    for (int i = 0; i < s; i++)
        for (int k = 0; k < DOF; k++) {
            double change = fabs(new[i][k] - g[i][k]);
            long long bits;
            memcpy(&bits, &change, sizeof bits);
            largest = bits > largest ? bits : largest;
            g[i][k] = new[i][k];
        }
    double size;
    memcpy(&size, &largest, sizeof size);
    return size;
}

/* Solve for g: 0, or 1 if that fails. */
static ALWAYS_INLINE int solve(int s, const double *restrict A2, double h, double at_rest[][DOF], double g[][DOF])
{
    double at[MAX_GAUSS][DOF], new[MAX_GAUSS][DOF], change, last = INFINITY;
    for (int m = 1; m <= MAX_ITERATIONS; m++) {
        combine(s, A2, g, at);
        for (int i = 0; i < s; i++)
            for (int k = 0; k < DOF; k++)
                at[i][k] = at_rest[i][k] + h * (h * at[i][k]);
        for (int i = 0; i < s; i++)
            acceleration(at[i], new[i]);
        change = replace(s, g, new);
        if (change == 0 || (m > 2 && change >= last))
            return 0;
        last = change;
    }
    return 1;
}

static ALWAYS_INLINE int gauss(int s, const double *restrict c, const double *restrict A2, const double *restrict b,
                               const double *restrict bA, const double *restrict ahead, double *y, double h, long steps)
{
    double v[DOF], q[DOF], g[MAX_GAUSS][DOF], last[MAX_GAUSS][DOF], at_rest[MAX_GAUSS][DOF];
    load(y, v, q);
    for (int i = 0; i < s; i++)
        acceleration(q, g[i]);
    for (long n = 0; n < steps; n++) {
        if (n > 0) {
            memcpy(last, g, s * sizeof g[0]);
            combine(s, ahead, last, g);
        }
        for (int i = 0; i < s; i++)
            for (int k = 0; k < DOF; k++)
                at_rest[i][k] = q[k] + h * (c[i] * v[k]);
        if (solve(s, A2, h, at_rest, g))
            return 1;
        for (int k = 0; k < DOF; k++) {
            double dv = 0, dq = 0;
            for (int i = 0; i < s; i++) {
                dv += b[i] * g[i][k];
                dq += bA[i] * g[i][k];
            }
            q[k] += h * (v[k] + h * dq);
            v[k] += h * dv;
        }
    }
    return store(y, v, q);
}

#define GAUSS(name, s)                                                                                                 \
    int name(double *y, double h, long steps)                                                                          \
    {                                                                                                                  \
        return gauss(s, name##_c, name##_A2, name##_b, name##_bA, name##_ahead, y, h, steps);                          \
    }
GAUSS(implicit_midpoint, 1)
GAUSS(gauss2, 2)
GAUSS(gauss3, 3)
GAUSS(gauss4, 4)
