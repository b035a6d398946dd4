/* The Sun and five planets in space: V(q) = -sum over pairs of G m_i m_j / r. Each pair once, action = reaction; the
   state holds velocities, so that no mass is divided by. The roots and divisions are in a loop of their own, where they
   are done several at a time. `gravity` is G m_i (coefficients.h). */
#define BODIES 6
#define PAIRS (BODIES * (BODIES - 1) / 2)
#define DOF (3 * BODIES)
#define MASS(k) mass[(k) / 3]

static inline void acceleration(const double *restrict q, double *restrict a)
{
    double dx[PAIRS], dy[PAIRS], dz[PAIRS], w[PAIRS];
    int k = 0;
#pragma GCC unroll 6
    for (int i = 0; i < BODIES; i++)
#pragma GCC unroll 6
        for (int j = i + 1; j < BODIES; j++, k++) {
            dx[k] = q[3 * i] - q[3 * j];
            dy[k] = q[3 * i + 1] - q[3 * j + 1];
            dz[k] = q[3 * i + 2] - q[3 * j + 2];
            w[k] = dx[k] * dx[k] + dy[k] * dy[k] + dz[k] * dz[k];
        }
#pragma GCC unroll 1
    for (k = 0; k < PAIRS; k++)
        w[k] = 1 / (w[k] * sqrt(w[k]));
    for (k = 0; k < DOF; k++)
        a[k] = 0;
    k = 0;
#pragma GCC unroll 6
    for (int i = 0; i < BODIES; i++)
#pragma GCC unroll 6
        for (int j = i + 1; j < BODIES; j++, k++) {
            double wi = gravity[i] * w[k], wj = gravity[j] * w[k];
            a[3 * i] -= wj * dx[k];
            a[3 * i + 1] -= wj * dy[k];
            a[3 * i + 2] -= wj * dz[k];
            a[3 * j] += wi * dx[k];
            a[3 * j + 1] += wi * dy[k];
            a[3 * j + 2] += wi * dz[k];
        }
}
