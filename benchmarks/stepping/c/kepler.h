/* The Kepler problem in the plane: V(q) = -1/|q|. */
#define DOF 2
#define MASS(k) 1.0

static inline void acceleration(const double *restrict q, double *restrict a)
{
    double r2 = q[0] * q[0] + q[1] * q[1], w = -1 / (r2 * sqrt(r2));
    a[0] = w * q[0];
    a[1] = w * q[1];
}
