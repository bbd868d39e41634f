/* Calls the integrator from C, and holds its results against differences and against each other. */
#include "casados_pendulum.h"

#include <math.h>
#include <stdio.h>

static _Alignas(CASADOS_ALIGNMENT) uint8_t memory[CASADOS_SIZE];

static int mistakes = 0;

static void expect(int holds, const char *what)
{
    if (!holds) {
        printf("not so: %s\n", what);
        mistakes++;
    }
}

int main(void)
{
    enum { N = CASADOS_STATES };
    const double h = 0.02, force = 1.0;
    const double x[N] = {0.1, 0.3, -0.2, 0.4};
    double next[N], same[N], dx[N * N], du[N];

    expect(casados_new(memory, 16, 5) == NULL, "memory that is too small is refused");
    expect(casados_new(memory + 1, sizeof memory - 1, 5) == NULL, "memory that is not aligned is refused");
    CasadosPendulum *pendulum = casados_new(memory, sizeof memory, 5);
    expect(pendulum != NULL, "there is an integrator");

    expect(casados_step(pendulum, x, &force, h, next, dx, du) == CasadosOk, "a step with derivatives");
    expect(casados_step(pendulum, x, &force, h, same, NULL, NULL) == CasadosOk, "a step without");
    for (int i = 0; i < N; i++)
        expect(next[i] == same[i], "both end in the same state");

    /* Central differences: an error of 1e-10 by their length, of 1e-11 by rounding. */
    const double d = 1e-5;
    for (int j = 0; j <= N; j++) {
        double above[N], below[N];
        for (int side = -1; side <= 1; side += 2) {
            double shifted[N], f = force;
            for (int i = 0; i < N; i++)
                shifted[i] = x[i] + (i == j ? side * d : 0.0);
            if (j == N)
                f += side * d;
            expect(casados_step(pendulum, shifted, &f, h, side > 0 ? above : below, NULL, NULL) == CasadosOk, "a step beside");
        }
        for (int i = 0; i < N; i++)
            expect(fabs((above[i] - below[i]) / (2 * d) - (j < N ? dx[j * N + i] : du[i])) < 1e-9, "derivatives are those of the step");
    }

    double kept = next[0];
    const double bad[N] = {NAN, 0.0, 0.0, 0.0};
    expect(casados_step(pendulum, bad, &force, h, next, NULL, NULL) == CasadosNonFinite, "a state that is not finite is refused");
    expect(casados_step(pendulum, NULL, &force, h, next, NULL, NULL) == CasadosInvalidPointer, "null is refused");
    expect(casados_step(NULL, x, &force, h, next, NULL, NULL) == CasadosInvalidPointer, "no integrator is refused");
    expect(next[0] == kept, "errors write nothing");

    printf("x = %.15g %.15g %.15g %.15g\n", next[0], next[1], next[2], next[3]);
    return mistakes != 0;
}
