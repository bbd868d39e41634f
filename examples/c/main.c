/* Calls the integrator from C, and holds its results against differences and against each other. */
#include "casados_pendulum.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

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

    CasadosPendulum *pendulum = (CasadosPendulum *)memory;
    expect(casados_new(memory, sizeof memory, 5, NULL) == CasadosNull, "no place for the integrator is refused");
    expect(casados_new(NULL, sizeof memory, 5, &pendulum) == CasadosNull, "no memory is refused");
    expect(casados_new(memory, 0, 5, &pendulum) == CasadosTooSmall, "empty memory is refused");
    expect(casados_new(memory, 16, 5, &pendulum) == CasadosTooSmall, "memory that is too small is refused");
    expect(casados_new(memory + 1, sizeof memory - 1, 5, &pendulum) == CasadosMisaligned, "memory that is not aligned is refused");
    expect(casados_new(memory, sizeof memory, 0, &pendulum) == CasadosInvalidOption, "no iterations are refused");
    expect(pendulum == NULL, "after an error there is no integrator");
    expect(casados_new(memory, sizeof memory, 5, &pendulum) == CasadosOk && pendulum != NULL, "there is an integrator");

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

    /* What is wrong is said, nothing is written, and the next call is as if it had not been. */
    const double *const point = x;
    const double bad[] = {NAN, INFINITY, -INFINITY};
    double out[N], out_dx[N * N], out_du[N];
    memset(out, 0x55, sizeof out);
    memset(out_dx, 0x55, sizeof out_dx);
    memset(out_du, 0x55, sizeof out_du);
    double untouched[N];
    memcpy(untouched, out, sizeof out);
    expect(casados_step(NULL, point, &force, h, out, out_dx, out_du) == CasadosNull, "no integrator is refused");
    expect(casados_step(pendulum, NULL, &force, h, out, out_dx, out_du) == CasadosNull, "no state is refused");
    expect(casados_step(pendulum, point, NULL, h, out, out_dx, out_du) == CasadosNull, "no control is refused");
    expect(casados_step(pendulum, point, &force, h, NULL, out_dx, out_du) == CasadosNull, "no place for the result is refused");
    const double *const crooked = (const double *)((uintptr_t)point + 1);
    expect(casados_step(pendulum, crooked, &force, h, out, out_dx, out_du) == CasadosMisaligned, "an odd address is refused");
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < N; j++) {
            double wrong[N];
            memcpy(wrong, x, sizeof wrong);
            wrong[j] = bad[i];
            expect(casados_step(pendulum, wrong, &force, h, out, out_dx, out_du) == CasadosNonFinite, "a state that is not finite is refused");
        }
        expect(casados_step(pendulum, point, &bad[i], h, out, out_dx, out_du) == CasadosNonFinite, "a control that is not finite is refused");
        expect(casados_step(pendulum, point, &force, bad[i], out, out_dx, out_du) == CasadosNonFinite, "a step that is not finite is refused");
    }
    const double huge[N] = {0.0, 0.3, 0.0, 1e200};
    expect(casados_step(pendulum, huge, &force, h, out, out_dx, out_du) == CasadosFailed, "what overflows is an error");
    expect(!memcmp(out, untouched, sizeof out) && !memcmp(out_du, untouched, sizeof out_du), "errors write no state");
    for (int i = 0; i < N; i++)
        expect(!memcmp(out_dx + N * i, untouched, sizeof untouched), "errors write no derivatives");

    expect(casados_step(pendulum, x, &force, h, out, out_dx, NULL) == CasadosOk, "derivatives with respect to the state alone");
    expect(casados_step(pendulum, x, &force, h, out, NULL, out_du) == CasadosOk, "derivatives with respect to the control alone");
    expect(!memcmp(out, next, sizeof out), "after errors a step is what it was");
    expect(!memcmp(out_dx, dx, sizeof dx) && !memcmp(out_du, du, sizeof du), "and so are derivatives");

    printf("x = %.15g %.15g %.15g %.15g\n", next[0], next[1], next[2], next[3]);
    return mistakes != 0;
}
