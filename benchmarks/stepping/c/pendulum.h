/* The pendulum: V(q) = -cos q. */
#define DOF 1
#define MASS(k) 1.0

static inline void acceleration(const double *restrict q, double *restrict a)
{
    a[0] = -sin(q[0]);
}
