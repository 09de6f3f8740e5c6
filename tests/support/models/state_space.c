/* An FMI 3.0 FMU of arrays: dx/dt = A x + B u, y = C x + D u, and arrays of each type. For
 * co-simulation and, at the end, model exchange.
 *
 * m inputs, n states and r outputs are structural parameters, set in configuration mode alone. A step
 * is exact for an input that is held over it. For each type T of FMI there is y_T = u_T, 2 x k.
 * It is strict: sizes must fit to the last value, a mode permits what FMI does.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

#define MOST 24 /* inputs, states or outputs */
#define WIDE (2 * MOST)

enum { TIME, M, N, R, K, A, B, C, D, X0, U, Y, X, IN = 100, OUT = 200 };
enum { INSTANTIATED, CONFIGURING, INITIALIZING, STEPPING };

typedef struct {
    fmi3UInt64 m, n, r, k;
    double a[MOST * MOST], b[MOST * MOST], c[MOST * MOST], d[MOST * MOST];
    double x0[MOST], u[MOST], x[MOST], time;
    fmi3Float64 u_Float64[2 * MOST]; fmi3Float32 u_Float32[2 * MOST];
    fmi3Int8 u_Int8[2 * MOST]; fmi3UInt8 u_UInt8[2 * MOST];
    fmi3Int16 u_Int16[2 * MOST]; fmi3UInt16 u_UInt16[2 * MOST];
    fmi3Int32 u_Int32[2 * MOST]; fmi3UInt32 u_UInt32[2 * MOST];
    fmi3Int64 u_Int64[2 * MOST], u_Enumeration[2 * MOST]; fmi3UInt64 u_UInt64[2 * MOST];
    fmi3Boolean u_Boolean[2 * MOST];
    int mode, continuous;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Model;

static fmi3Status fail(Model *s, const char *text) {
    if (s->log) s->log(s->environment, fmi3Error, "logStatus", text);
    return fmi3Error;
}

static void identity(double *matrix, size_t rows, size_t columns) {
    for (size_t i = 0; i < rows * columns; i++) matrix[i] = i / columns == i % columns;
}

/* Start values of the sizes that there are now. */
static void reset(Model *s) {
    identity(s->a, s->n, s->n);
    identity(s->b, s->n, s->m);
    identity(s->c, s->r, s->n);
    identity(s->d, s->r, s->m);
    for (size_t i = 0; i < MOST; i++) {
        s->x0[i] = 0.0;
        s->u[i] = (double)(i + 1);
    }
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early,
    const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    Model *s = calloc(1, sizeof(Model));
    (void)name; (void)resources; (void)visible; (void)event_mode; (void)early; (void)required;
    (void)n; (void)update;
    if (strcmp(token, "{state space}")) {
        free(s);
        return NULL;
    }
    s->environment = environment;
    s->log = logging ? log : NULL;
    s->m = s->n = s->r = s->k = 3;
    for (int i = 0; i < 2 * MOST; i++) s->u_Enumeration[i] = 1;
    reset(s);
    return s;
}

void fmi3FreeInstance(fmi3Instance instance) { free(instance); }
const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    Model *s = instance;
    if (s->mode != INSTANTIATED) return fail(s, "no configuration mode from here");
    s->mode = CONFIGURING;
    return fmi3OK;
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    Model *s = instance;
    s->mode = INSTANTIATED;
    reset(s);
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean tolerant, fmi3Float64 tolerance, fmi3Float64 start,
    fmi3Boolean stops, fmi3Float64 stop) {
    Model *s = instance;
    (void)tolerant; (void)tolerance; (void)stops; (void)stop;
    s->time = start;
    s->mode = INITIALIZING;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    Model *s = instance;
    memcpy(s->x, s->x0, sizeof s->x);
    s->mode = STEPPING;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance) { (void)instance; return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance instance) { (void)instance; return fmi3Error; }

/* c += a b, where a has so many rows, and as many columns as b has elements */
static void add(double *c, const double *a, const double *b, size_t rows, size_t columns) {
    for (size_t i = 0; i < rows; i++)
        for (size_t j = 0; j < columns; j++) c[i] += a[i * columns + j] * b[j];
}

static void outputs(const Model *s, double *y) {
    const double *x = s->mode == STEPPING ? s->x : s->x0;
    memset(y, 0, s->r * sizeof *y);
    add(y, s->c, x, s->r, s->n);
    add(y, s->d, s->u, s->r, s->m);
}

/* Where a variable is, and how many elements it has. */
static double *place(Model *s, fmi3ValueReference r, size_t *size) {
    switch (r) {
    case A: *size = s->n * s->n; return s->a;
    case B: *size = s->n * s->m; return s->b;
    case C: *size = s->r * s->n; return s->c;
    case D: *size = s->r * s->m; return s->d;
    case X0: *size = s->n; return s->x0;
    case U: *size = s->m; return s->u;
    case X: *size = s->n; return s->mode == STEPPING ? s->x : s->x0;
    case IN: case OUT: *size = 2 * s->k; return s->u_Float64;
    case TIME: *size = 1; return &s->time;
    default: return NULL;
    }
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference r[], size_t n,
                          const fmi3Float64 v[], size_t nv) {
    Model *s = instance;
    size_t at = 0, size;
    for (size_t i = 0; i < n; i++, at += size) {
        double *to = place(s, r[i], &size);
        if (s->continuous) return fail(s, "not in event mode");
        if (!to || r[i] == X || r[i] == OUT || r[i] == TIME) return fail(s, "not settable");
        if (r[i] == X0 && s->mode == STEPPING) return fail(s, "x0 is fixed");
        if (at + size > nv) return fail(s, "too few values");
        memcpy(to, v + at, size * sizeof *v);
    }
    return at == nv ? fmi3OK : fail(s, "too many values");
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference r[], size_t n,
                          fmi3Float64 v[], size_t nv) {
    Model *s = instance;
    double y[MOST];
    size_t at = 0, size;
    if (s->mode < INITIALIZING) return fail(s, "values are not there yet");
    for (size_t i = 0; i < n; i++, at += size) {
        const double *from = r[i] == Y ? (outputs(s, y), size = s->r, y) : place(s, r[i], &size);
        if (!from) return fail(s, "no such variable");
        if (at + size > nv) return fail(s, "too little room");
        memcpy(v + at, from, size * sizeof *v);
    }
    return at == nv ? fmi3OK : fail(s, "too much room");
}

#define PASS(FUNCTION, find) \
    fmi3Status fmi3Set##FUNCTION(fmi3Instance instance, const fmi3ValueReference r[], size_t n, \
                                 const fmi3##FUNCTION v[], size_t nv) { \
        Model *s = instance; \
        size_t at = 0, size; \
        for (size_t i = 0; i < n; i++, at += size) { \
            fmi3##FUNCTION *to = NULL; \
            size = 2 * s->k; \
            { fmi3ValueReference q = r[i]; int set = 1; (void)set; find } \
            if (!to) return fail(s, "not settable as " #FUNCTION); \
            if (at + size > nv) return fail(s, "too few values"); \
            memcpy(to, v + at, size * sizeof *v); \
        } \
        return at == nv ? fmi3OK : fail(s, "too many values"); \
    } \
    fmi3Status fmi3Get##FUNCTION(fmi3Instance instance, const fmi3ValueReference r[], size_t n, \
                                 fmi3##FUNCTION v[], size_t nv) { \
        Model *s = instance; \
        size_t at = 0, size; \
        if (s->mode < INITIALIZING) return fail(s, "values are not there yet"); \
        for (size_t i = 0; i < n; i++, at += size) { \
            fmi3##FUNCTION *to = NULL; \
            size = 2 * s->k; \
            { fmi3ValueReference q = r[i]; int set = 0; (void)set; find } \
            if (!to) return fail(s, "no such variable"); \
            if (at + size > nv) return fail(s, "too little room"); \
            memcpy(v + at, to, size * sizeof *v); \
        } \
        return at == nv ? fmi3OK : fail(s, "too much room"); \
    }
#define OF(T, id) if (q == IN + id || (!set && q == OUT + id)) to = s->u_##T;
#define SIZE(reference, member) \
    if (q == reference) { \
        if (set && s->mode != CONFIGURING) return fail(s, "not in configuration mode"); \
        if (set && v[at] > MOST) return fail(s, "at most 24"); \
        to = &s->member; \
        size = 1; \
    }

PASS(Float32, OF(Float32, 1))
PASS(Int8, OF(Int8, 2))
PASS(UInt8, OF(UInt8, 3))
PASS(Int16, OF(Int16, 4))
PASS(UInt16, OF(UInt16, 5))
PASS(Int32, OF(Int32, 6))
PASS(UInt32, OF(UInt32, 7))
PASS(Int64, OF(Int64, 8) OF(Enumeration, 11))
PASS(UInt64, OF(UInt64, 9) SIZE(M, m) SIZE(N, n) SIZE(R, r) SIZE(K, k))
PASS(Boolean, OF(Boolean, 10))

/* p = q f, all square and of the same size */
static void multiply(double *p, const double *q, const double *f, size_t size) {
    for (size_t i = 0; i < size; i++)
        for (size_t j = 0; j < size; j++) {
            double sum = 0.0;
            for (size_t k = 0; k < size; k++) sum += q[i * size + k] * f[k * size + j];
            p[i * size + j] = sum;
        }
}

/* x at the end of a step: the exponential of h [[A, B], [0, 0]], by its series, scaled and squared. */
static void advance(Model *s, double h) {
    static double g[WIDE * WIDE], e[WIDE * WIDE], term[WIDE * WIDE], next[WIDE * WIDE];
    size_t size = s->n + s->m, cells = size * size;
    double scale = h / 1024.0, x[MOST] = {0.0};

    for (size_t i = 0; i < size; i++)
        for (size_t j = 0; j < size; j++) {
            double entry = i >= s->n ? 0.0 : j < s->n ? s->a[i * s->n + j] : s->b[i * s->m + j - s->n];
            g[i * size + j] = scale * entry;
            e[i * size + j] = term[i * size + j] = i == j;
        }
    for (int k = 1; k < 20; k++) {
        multiply(next, term, g, size);
        for (size_t i = 0; i < cells; i++) e[i] += term[i] = next[i] / k;
    }
    for (int k = 0; k < 10; k++) {
        multiply(next, e, e, size);
        memcpy(e, next, cells * sizeof *e);
    }
    for (size_t i = 0; i < s->n; i++) {
        for (size_t j = 0; j < s->n; j++) x[i] += e[i * size + j] * s->x[j];
        for (size_t j = 0; j < s->m; j++) x[i] += e[i * size + s->n + j] * s->u[j];
    }
    memcpy(s->x, x, sizeof x);
}

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set,
    fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    Model *s = instance;
    (void)no_set;
    *event = *terminate = *early = fmi3False;
    if (s->mode != STEPPING) return fail(s, "not in step mode");
    advance(s, step);
    s->time = *last = time + step;
    return fmi3OK;
}

/* Model exchange */

fmi3Instance fmi3InstantiateModelExchange(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    return fmi3InstantiateCoSimulation(name, token, resources, visible, logging, fmi3False,
                                       fmi3False, NULL, 0, environment, log, NULL);
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    ((Model *)instance)->continuous = 0;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(
    fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
    fmi3Boolean *states, fmi3Boolean *defined, fmi3Float64 *next) {
    (void)instance; (void)next;
    *again = *terminate = *nominals = *states = *defined = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    ((Model *)instance)->continuous = 1;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    ((Model *)instance)->time = time;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n) {
    *n = ((Model *)instance)->n;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n) {
    (void)instance;
    *n = 0;
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 x[], size_t n) {
    Model *s = instance;
    if (n != s->n) return fail(s, "another number of states");
    memcpy(s->x, x, n * sizeof *x);
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 x[], size_t n) {
    Model *s = instance;
    if (n != s->n) return fail(s, "another number of states");
    memcpy(x, s->x, n * sizeof *x);
    return fmi3OK;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 x[], size_t n) {
    (void)instance;
    for (size_t i = 0; i < n; i++) x[i] = 1.0;
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 dx[], size_t n) {
    Model *s = instance;
    memset(dx, 0, n * sizeof *dx);
    add(dx, s->a, s->x, s->n, s->n);
    add(dx, s->b, s->u, s->n, s->m);
    return fmi3OK;
}
