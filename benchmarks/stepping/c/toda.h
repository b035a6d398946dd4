/* The periodic Toda lattice of three particles: V(q) = sum of exp(q_k - q_{k+1}). */
#define DOF 3
#define MASS(k) 1.0

static inline void acceleration(const double *restrict q, double *restrict a)
{
    double e0 = exp(q[0] - q[1]), e1 = exp(q[1] - q[2]), e2 = exp(q[2] - q[0]);
    a[0] = e2 - e0;
    a[1] = e0 - e1;
    a[2] = e1 - e2;
}
