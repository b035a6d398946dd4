/* Explicit methods. */

#define MAX_COMPOSED 64

/* Kick, drift, kick: half kicks that follow one another are one, the last is taken back by half. */
int stormer_verlet_kdk(double *y, double h, long steps)
{
    double v[DOF], q[DOF], a[DOF];
    load(y, v, q);
    acceleration(q, a);
    for (int k = 0; k < DOF; k++)
        v[k] += h / 2 * a[k];
    for (long n = 0; n < steps; n++) {
        for (int k = 0; k < DOF; k++)
            q[k] += h * v[k];
        acceleration(q, a);
        for (int k = 0; k < DOF; k++)
            v[k] += h * a[k];
    }
    for (int k = 0; k < DOF; k++)
        v[k] -= h / 2 * a[k];
    return store(y, v, q);
}

/* Stormer-Verlet steps of size gamma[0] h, gamma[1] h, ... in turn, with one evaluation each. */
int composition(double *y, double h, long steps, int stages, const double *gamma)
{
    double v[DOF], q[DOF], a[DOF], drift[MAX_COMPOSED], kick[MAX_COMPOSED];
    for (int i = 0; i < stages; i++) {
        drift[i] = h * gamma[i];
        kick[i] = h * (gamma[i] + gamma[(i + 1) % stages]) / 2;
    }
    load(y, v, q);
    acceleration(q, a);
    for (int k = 0; k < DOF; k++)
        v[k] += drift[0] / 2 * a[k];
    for (long n = 0; n < steps; n++)
        for (int i = 0; i < stages; i++) {
            for (int k = 0; k < DOF; k++)
                q[k] += drift[i] * v[k];
            acceleration(q, a);
            for (int k = 0; k < DOF; k++)
                v[k] += kick[i] * a[k];
        }
    for (int k = 0; k < DOF; k++)
        v[k] -= drift[0] / 2 * a[k];
    return store(y, v, q);
}

/* The classical Runge-Kutta method on the system of first order: the stages' slopes are (a_i, v_i). */
int rk4(double *y, double h, long steps)
{
    double v[DOF], q[DOF], v2[DOF], v3[DOF], v4[DOF], at[DOF], a1[DOF], a2[DOF], a3[DOF], a4[DOF];
    load(y, v, q);
    for (long n = 0; n < steps; n++) {
        acceleration(q, a1);
        for (int k = 0; k < DOF; k++) {
            v2[k] = v[k] + h / 2 * a1[k];
            at[k] = q[k] + h / 2 * v[k];
        }
        acceleration(at, a2);
        for (int k = 0; k < DOF; k++) {
            v3[k] = v[k] + h / 2 * a2[k];
            at[k] = q[k] + h / 2 * v2[k];
        }
        acceleration(at, a3);
        for (int k = 0; k < DOF; k++) {
            v4[k] = v[k] + h * a3[k];
            at[k] = q[k] + h * v3[k];
        }
        acceleration(at, a4);
        for (int k = 0; k < DOF; k++) {
            q[k] += h / 6 * (v[k] + 2 * (v2[k] + v3[k]) + v4[k]);
            v[k] += h / 6 * (a1[k] + 2 * (a2[k] + a3[k]) + a4[k]);
        }
    }
    return store(y, v, q);
}
