/* Nine atoms in the plane: V(q) = sum over pairs of 4 (r^-12 - r^-6). Each pair once, action = reaction. All differences
   first, then the divisions, several at a time, then the sums: half the time of one loop over the pairs. */
#define ATOMS 9
#define PAIRS (ATOMS * (ATOMS - 1) / 2)
#define DOF (2 * ATOMS)
#define MASS(k) 1.0

static inline void acceleration(const double *restrict q, double *restrict a)
{
    double dx[PAIRS], dy[PAIRS], w[PAIRS];
    int k = 0;
#pragma GCC unroll 9
    for (int i = 0; i < ATOMS; i++)
#pragma GCC unroll 9
        for (int j = i + 1; j < ATOMS; j++, k++) {
            dx[k] = q[2 * i] - q[2 * j];
            dy[k] = q[2 * i + 1] - q[2 * j + 1];
        }
    for (k = 0; k < PAIRS; k++) {
        double s = 1 / (dx[k] * dx[k] + dy[k] * dy[k]), s3 = s * s * s;
        w[k] = 24 * s * s3 * (2 * s3 - 1);
    }
    for (k = 0; k < DOF; k++)
        a[k] = 0;
    k = 0;
#pragma GCC unroll 9
    for (int i = 0; i < ATOMS; i++)
#pragma GCC unroll 9
        for (int j = i + 1; j < ATOMS; j++, k++) {
            double fx = w[k] * dx[k], fy = w[k] * dy[k];
            a[2 * i] += fx;
            a[2 * i + 1] += fy;
            a[2 * j] -= fx;
            a[2 * j + 1] -= fy;
        }
}
