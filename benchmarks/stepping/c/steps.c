/* All methods for one scene, q' = v, v' = acceleration(q): gcc -O3 -march=native -DSCENE='"kepler.h"' steps.c
   A method takes the state y = (p, q) with p = m v, moves it on by so many steps of size h, and returns 0, or 1 if
   an iteration does not end or the state is not finite. */
#include <math.h>
#include <string.h>

#include "coefficients.h"
#include SCENE

#define ALWAYS_INLINE inline __attribute__((always_inline))

static inline void load(const double *restrict y, double *restrict v, double *restrict q)
{
    for (int k = 0; k < DOF; k++) {
        v[k] = y[k] / MASS(k);
        q[k] = y[DOF + k];
    }
}

static inline int store(double *restrict y, const double *restrict v, const double *restrict q)
{
    int failed = 0;
    for (int k = 0; k < DOF; k++) {
        y[k] = MASS(k) * v[k];
        y[DOF + k] = q[k];
        failed |= !isfinite(v[k]) || !isfinite(q[k]);
    }
    return failed;
}

#include "explicit.h"
#include "gauss.h"
