/* Calls of acados' integrators, timed where they are made: nothing of Python is in the times.
 *
 * Compiled by acados_common.py against one installation of acados and loaded before acados' own libraries, so that the two
 * functions below replace acados' clock: a call of an integrator reads it up to a hundred times. It is silent unless asked for. */

#define _POSIX_C_SOURCE 200809L
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "acados/sim/sim_common.h"
#include "acados/utils/timing.h"
#include "acados_c/sim_interface.h"

/* Whether acados is told the time. */
int driver_clock = 0;

static double read_clock(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

void acados_tic(acados_timer *timer)
{
    double now = driver_clock ? read_clock(CLOCK_MONOTONIC) : 0.0;
    memcpy(timer, &now, sizeof now);
}

double acados_toc(acados_timer *timer)
{
    double then;
    memcpy(&then, timer, sizeof then);
    return driver_clock ? read_clock(CLOCK_MONOTONIC) - then : 0.0;
}

/* What is asked of the integrator. */
typedef struct
{
    int stages, steps, radau, iterations, reuse;
    double tolerance;
    int forward, adjoint, hessian;
} question;

/* A solver, its arguments, and where its results lie. */
typedef struct
{
    sim_solver *solver;
    sim_in *in;
    sim_out *out;
    double *lambda; /* The seed of the adjoint: nx numbers, then nu zeros. */
} peer;

static void flag(sim_config *config, void *opts, const char *name, int on)
{
    bool value = on;
    sim_opts_set(config, opts, name, &value);
}

/* Fills in the solver of a question to a generated model; 0 if that is possible. */
int driver_open(sim_config *config, void *dims, const question *q, peer *p)
{
    void *opts = sim_opts_create(config, dims);
    sim_collocation_type type = q->radau ? GAUSS_RADAU_IIA : GAUSS_LEGENDRE;
    sim_opts_set(config, opts, "collocation_type", &type);
    sim_opts_set(config, opts, "num_stages", (void *)&q->stages);
    sim_opts_set(config, opts, "num_steps", (void *)&q->steps);
    sim_opts_set(config, opts, "newton_iter", (void *)&q->iterations);
    sim_opts_set(config, opts, "newton_tol", (void *)&q->tolerance);
    flag(config, opts, "jac_reuse", q->reuse);
    flag(config, opts, "sens_forw", q->forward);
    flag(config, opts, "sens_adj", q->adjoint);
    flag(config, opts, "sens_hess", q->hessian);
    flag(config, opts, "output_z", 0);
    flag(config, opts, "sens_algebraic", 0);
    p->solver = sim_solver_create(config, dims, opts, p->in);
    p->in->identity_seed = true; /* What S_forw is, and saves a product. */
    return sim_precompute(p->solver, p->in, p->out);
}

/* One call from a cold start: stages are zero. Inputs are read where they lie, nothing is copied. */
int driver_call(const peer *p, double *x, double *u)
{
    sim_solver *s = p->solver;
    s->config->memory_set_to_zero(s->config, s->dims, s->opts, s->mem);
    p->in->x = x;
    p->in->u = u;
    p->in->S_adj = p->lambda;
    return sim_solve(s, p->in, p->out);
}

static double now(void) { return read_clock(CLOCK_THREAD_CPUTIME_ID); }

static double wall(void) { return read_clock(CLOCK_MONOTONIC); }

static int ascending(const void *a, const void *b)
{
    double d = *(const double *)a - *(const double *)b;
    return (d > 0) - (d < 0);
}

/* CPU seconds of one call: as benches/src/time.rs, a tenth of the budget to warm up, then samples of at least 0.2 ms until it is
 * spent, never fewer than nine. Inputs are `count` pairs (x, u), one pair after the other; a pass takes all of them. Gives
 * median, first and third quartile, returns the number of samples, or -1. */
int driver_time(const peer *p, double *inputs, int count, int nx, int nu, double budget, double *quartiles)
{
    enum { MOST = 20000 };
    static double samples[MOST];
    int status = 0, repetitions = 1, found = 0, width = nx + nu;
    double begin = wall();
    for (;;)
    {
        double start = now();
        for (int r = 0; r < repetitions; r++)
            for (int k = 0; k < count; k++) status |= driver_call(p, inputs + k * width, inputs + k * width + nx);
        if (now() - start < 2e-4)
            repetitions *= 2;
        else if (wall() - begin > budget / 10)
            break;
    }
    begin = wall();
    while (found < MOST && (found < 9 || wall() - begin < budget))
    {
        double start = now();
        for (int r = 0; r < repetitions; r++)
            for (int k = 0; k < count; k++) status |= driver_call(p, inputs + k * width, inputs + k * width + nx);
        samples[found++] = (now() - start) / repetitions / count;
    }
    qsort(samples, found, sizeof(double), ascending);
    for (int i = 0; i < 3; i++)
    {
        const double at[3] = {0.5, 0.25, 0.75};
        quartiles[i] = samples[(int)(at[i] * (found - 1) + 0.5)];
    }
    return status ? -1 : found;
}
