/* An FMI 3.0 co-simulation FMU that hands every scalar type through and misbehaves on demand.
 *
 * y_T = u_T for each type T; x integrates gain * u_Float64. The parameters *_at are times in s at
 * which the step that contains them goes wrong.
 * Functions that this kind of FMU does not need are left out, as vendors do.
 * interrupt_at has the process of the number in interrupted get SIGINT from within that step.
 */
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi3Functions.h"

enum { CRASH = 1, EXIT, HANG, ERROR, DISCARD, EARLY, TERMINATE, GAIN, INTERRUPT, INTERRUPTED, LAST };
enum { X = 20, TIME, STEPS = 30, SIZE = 40, SIZE_OUT, IN = 100, OUT = 200 };

typedef struct {
    double p[LAST], x, time, u_Float64;
    float u_Float32;
    fmi3Int8 u_Int8; fmi3UInt8 u_UInt8; fmi3Int16 u_Int16; fmi3UInt16 u_UInt16;
    fmi3Int32 u_Int32; fmi3UInt32 u_UInt32; fmi3Int64 u_Int64; fmi3UInt64 u_UInt64;
    fmi3Boolean u_Boolean;
    fmi3Int64 u_Enumeration;
    char u_String[256];
    fmi3UInt64 steps, size;
    int configuring, running, early_allowed;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Model;

static fmi3Status fail(Model *m, fmi3Status status, const char *text) {
    if (m->log) m->log(m->environment, status, "logStatus", text);
    return status;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early,
    const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    Model *m = calloc(1, sizeof(Model));
    (void)name; (void)visible; (void)event_mode; (void)required; (void)n; (void)update;
    m->environment = environment;
    m->log = logging ? log : NULL;
    if (strcmp(token, "{native}")) {
        fail(m, fmi3Error, "wrong instantiation token");
        free(m);
        return NULL;
    }
    if (access(resources, R_OK)) {
        fail(m, fmi3Error, "resources are not there");
        free(m);
        return NULL;
    }
    for (int i = 0; i < LAST; i++) m->p[i] = 1e9;
    m->p[GAIN] = 1.0;
    m->size = 3;
    m->early_allowed = early;
    printf("native FMU 3.0 instantiated\n"); /* pollutes standard output, as vendors do */
    fflush(stdout);
    return m;
}

void fmi3FreeInstance(fmi3Instance instance) { free(instance); }
const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    ((Model *)instance)->configuring = 1;
    return fmi3OK;
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    ((Model *)instance)->configuring = 0;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean tolerant, fmi3Float64 tolerance, fmi3Float64 start,
    fmi3Boolean stops, fmi3Float64 stop) {
    Model *m = instance;
    (void)tolerant; (void)tolerance; (void)stops; (void)stop;
    m->time = start;
    if (m->p[GAIN] < 0.0) return fail(m, fmi3Error, "gain must be >= 0");
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    ((Model *)instance)->running = 1;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance) { (void)instance; return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance instance) { (void)instance; return fmi3Error; }

/* u_T is at IN + id, y_T at OUT + id */
#define PASS(T, FUNCTION, id, set_more, get_more) \
    fmi3Status fmi3Set##FUNCTION(fmi3Instance instance, const fmi3ValueReference r[], size_t n, \
                          const fmi3##FUNCTION v[], size_t nv) { \
        Model *m = instance; \
        if (n != nv) return fail(m, fmi3Error, "sizes differ"); \
        for (size_t i = 0; i < n; i++) { \
            if (r[i] == IN + id) m->u_##T = v[i]; \
            else set_more \
            else return fail(m, fmi3Error, "not settable as " #FUNCTION); \
        } \
        return fmi3OK; \
    } \
    fmi3Status fmi3Get##FUNCTION(fmi3Instance instance, const fmi3ValueReference r[], size_t n, \
                          fmi3##FUNCTION v[], size_t nv) { \
        Model *m = instance; \
        if (n != nv) return fail(m, fmi3Error, "sizes differ"); \
        for (size_t i = 0; i < n; i++) { \
            if (r[i] == OUT + id || r[i] == IN + id) v[i] = m->u_##T; \
            else get_more \
            else return fail(m, fmi3Error, "not gettable as " #FUNCTION); \
        } \
        return fmi3OK; \
    }
#define NONE if (0) {}

PASS(Float64, Float64, 0,
     if (r[i] > 0 && r[i] < LAST) m->p[r[i]] = v[i];,
     if (r[i] == X) v[i] = m->x;
     else if (r[i] == TIME) v[i] = m->time;
     else if (r[i] > 0 && r[i] < LAST) v[i] = m->p[r[i]];)
PASS(Float32, Float32, 1, NONE, NONE)
PASS(Int8, Int8, 2, NONE, NONE)
PASS(UInt8, UInt8, 3, NONE, NONE)
PASS(Int16, Int16, 4, NONE, NONE)
PASS(UInt16, UInt16, 5, NONE, NONE)
PASS(Int32, Int32, 6, NONE, NONE)
PASS(UInt32, UInt32, 7, NONE, NONE)
PASS(Int64, Int64, 8,
     if (r[i] == IN + 11) m->u_Enumeration = v[i];,
     if (r[i] == OUT + 11 || r[i] == IN + 11) v[i] = m->u_Enumeration;)
PASS(UInt64, UInt64, 9,
     if (r[i] == SIZE && !m->configuring) return fail(m, fmi3Error, "not in configuration mode");
     else if (r[i] == SIZE) m->size = v[i];,
     if (r[i] == STEPS) v[i] = m->steps;
     else if (r[i] == SIZE_OUT || r[i] == SIZE) v[i] = m->size;)
PASS(Boolean, Boolean, 10, NONE, NONE)

fmi3Status fmi3SetString(fmi3Instance instance, const fmi3ValueReference r[], size_t n,
                         const fmi3String v[], size_t nv) {
    Model *m = instance;
    for (size_t i = 0; i < n; i++) {
        if (r[i] != IN + 12 || nv != n) return fail(m, fmi3Error, "not settable as String");
        snprintf(m->u_String, sizeof m->u_String, "%s", v[i]);
    }
    return fmi3OK;
}

fmi3Status fmi3GetString(fmi3Instance instance, const fmi3ValueReference r[], size_t n,
                         fmi3String v[], size_t nv) {
    Model *m = instance;
    for (size_t i = 0; i < n; i++) {
        if ((r[i] != OUT + 12 && r[i] != IN + 12) || nv != n)
            return fail(m, fmi3Error, "not gettable as String");
        v[i] = m->u_String;
    }
    return fmi3OK;
}

static int within(Model *m, int what, double begin, double step) {
    return m->p[what] > begin + 1e-12 && m->p[what] < begin + step - 1e-12;
}

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set,
    fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    Model *m = instance;
    double end = time + step;
    (void)no_set;
    *event = *terminate = *early = fmi3False;
    if (!m->running) return fail(m, fmi3Error, "not in step mode");
    if (within(m, CRASH, time, step)) *(volatile int *)0 = 1;
    if (within(m, EXIT, time, step)) _exit(7);
    if (within(m, INTERRUPT, time, step)) kill((pid_t)m->p[INTERRUPTED], SIGINT);
    if (within(m, HANG, time, step)) dprintf(STDERR_FILENO, "native FMU hangs\n");
    while (within(m, HANG, time, step)) pause();
    if (within(m, ERROR, time, step)) return fail(m, fmi3Error, "the lamp\nis broken");
    if (within(m, DISCARD, time, step)) return fail(m, fmi3Discard, "the step is too long");
    if (within(m, TERMINATE, time, step)) {
        *terminate = fmi3True;
        end = m->p[TERMINATE];
    }
    if (m->early_allowed && within(m, EARLY, time, step)) {
        *early = fmi3True;
        end = m->p[EARLY];
    }
    m->x += m->p[GAIN] * m->u_Float64 * (end - time);
    m->time = *last = end;
    m->steps++;
    return fmi3OK;
}
