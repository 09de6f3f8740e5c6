/* An FMI 2.0 co-simulation FMU that hands every scalar type through and misbehaves on demand.
 *
 * y_T = u_T for each type T; x integrates gain * u_Real. The parameters *_at are times in s at which
 * the step that contains them goes wrong.
 * interrupt_at has the process of the number in interrupted get SIGINT from within that step.
 */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2Functions.h"

enum { CRASH = 1, EXIT, HANG, ERROR, DISCARD, EARLY, TERMINATE, GAIN, INTERRUPT, INTERRUPTED, LAST };
enum { X = 20, TIME, STEPS = 30, IN = 100, OUT = 200 };

typedef struct {
    double p[LAST], x, time, last, u_Real;
    int u_Integer, u_Boolean, u_Enumeration;
    char u_String[256];
    int steps, running, terminated;
    char name[256];
    const fmi2CallbackFunctions *host;
} Model;

static fmi2Status fail(Model *m, fmi2Status status, const char *text) {
    m->host->logger(m->host->componentEnvironment, m->name, status, "logStatus", "%s", text);
    return status;
}

fmi2Component fmi2Instantiate(
    fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging) {
    Model *m = calloc(1, sizeof(Model));
    (void)type; (void)resources; (void)visible; (void)logging;
    m->host = host;
    snprintf(m->name, sizeof m->name, "%s", name);
    if (strcmp(guid, "{native}")) {
        fail(m, fmi2Error, "wrong GUID");
        free(m);
        return NULL;
    }
    for (int i = 0; i < LAST; i++) m->p[i] = 1e9;
    m->p[GAIN] = 1.0;
    printf("native FMU 2.0 instantiated\n"); /* pollutes standard output, as vendors do */
    fflush(stdout);
    return m;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stops, fmi2Real stop) {
    (void)tolerant; (void)tolerance; (void)stops; (void)stop;
    ((Model *)c)->time = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Model *m = c;
    return m->p[GAIN] < 0.0 ? fail(m, fmi2Error, "gain must be >= 0") : fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    ((Model *)c)->running = 1;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }

#define EACH(n) for (size_t i = 0; i < (n); i++)
#define PASS(T, id, type, set_more, get_more) \
    fmi2Status fmi2Set##T(fmi2Component c, const fmi2ValueReference r[], size_t n, \
                          const type v[]) { \
        Model *m = c; \
        EACH(n) { \
            if (r[i] == IN + id) m->u_##T = v[i]; \
            else set_more \
            else return fail(m, fmi2Error, "not settable as " #T); \
        } \
        return fmi2OK; \
    } \
    fmi2Status fmi2Get##T(fmi2Component c, const fmi2ValueReference r[], size_t n, type v[]) { \
        Model *m = c; \
        EACH(n) { \
            if (r[i] == OUT + id || r[i] == IN + id) v[i] = m->u_##T; \
            else get_more \
            else return fail(m, fmi2Error, "not gettable as " #T); \
        } \
        return fmi2OK; \
    }

PASS(Real, 0, fmi2Real,
     if (r[i] > 0 && r[i] < LAST) m->p[r[i]] = v[i];,
     if (r[i] == X) v[i] = m->x;
     else if (r[i] == TIME) v[i] = m->time;
     else if (r[i] > 0 && r[i] < LAST) v[i] = m->p[r[i]];)
PASS(Integer, 6, fmi2Integer,
     if (r[i] == IN + 11) m->u_Enumeration = v[i];,
     if (r[i] == OUT + 11 || r[i] == IN + 11) v[i] = m->u_Enumeration;
     else if (r[i] == STEPS) v[i] = m->steps;)
PASS(Boolean, 10, fmi2Boolean, if (0) {}, if (0) {})

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n,
                         const fmi2String v[]) {
    Model *m = c;
    EACH(n) {
        if (r[i] != IN + 12) return fail(m, fmi2Error, "not settable as String");
        snprintf(m->u_String, sizeof m->u_String, "%s", v[i]);
    }
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n,
                         fmi2String v[]) {
    Model *m = c;
    EACH(n) {
        if (r[i] != OUT + 12 && r[i] != IN + 12) return fail(m, fmi2Error, "not gettable as String");
        v[i] = m->u_String;
    }
    return fmi2OK;
}

static int within(Model *m, int what, double begin, double step) {
    return m->p[what] > begin + 1e-12 && m->p[what] < begin + step - 1e-12;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set) {
    Model *m = c;
    double end = time + step;
    fmi2Status status = fmi2OK;
    (void)no_set;
    if (!m->running) return fail(m, fmi2Error, "not in step mode");
    if (within(m, CRASH, time, step)) *(volatile int *)0 = 1;
    if (within(m, EXIT, time, step)) _exit(7);
    if (within(m, INTERRUPT, time, step)) kill((pid_t)m->p[INTERRUPTED], SIGINT);
    if (within(m, HANG, time, step)) dprintf(STDERR_FILENO, "native FMU hangs\n");
    while (within(m, HANG, time, step)) pause();
    if (within(m, ERROR, time, step)) return fail(m, fmi2Error, "the lamp\nis broken");
    if (within(m, DISCARD, time, step)) {
        m->last = time;
        return fail(m, fmi2Discard, "the step is too long");
    }
    m->terminated = within(m, TERMINATE, time, step);
    if (m->terminated || within(m, EARLY, time, step)) {
        status = fmi2Discard;
        end = m->p[m->terminated ? TERMINATE : EARLY];
    }
    m->x += m->p[GAIN] * m->u_Real * (end - time);
    m->time = m->last = end;
    m->steps++;
    return status;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    *value = ((Model *)c)->last;
    return kind == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    *value = ((Model *)c)->terminated;
    return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}

#define STUB(name, ...) fmi2Status name(fmi2Component c, __VA_ARGS__) { (void)c; return fmi2Error; }
fmi2Status fmi2Reset(fmi2Component c) { (void)c; return fmi2Error; }
fmi2Status fmi2CancelStep(fmi2Component c) { (void)c; return fmi2Error; }
STUB(fmi2SetDebugLogging, fmi2Boolean on, size_t n, const fmi2String names[])
STUB(fmi2GetFMUstate, fmi2FMUstate *s)
STUB(fmi2SetFMUstate, fmi2FMUstate s)
STUB(fmi2FreeFMUstate, fmi2FMUstate *s)
STUB(fmi2SerializedFMUstateSize, fmi2FMUstate s, size_t *n)
STUB(fmi2SerializeFMUstate, fmi2FMUstate s, fmi2Byte b[], size_t n)
STUB(fmi2DeSerializeFMUstate, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
STUB(fmi2GetDirectionalDerivative, const fmi2ValueReference u[], size_t nu,
     const fmi2ValueReference k[], size_t nk, const fmi2Real dk[], fmi2Real du[])
STUB(fmi2SetRealInputDerivatives, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
     const fmi2Real v[])
STUB(fmi2GetRealOutputDerivatives, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
     fmi2Real v[])
STUB(fmi2GetStatus, const fmi2StatusKind k, fmi2Status *v)
STUB(fmi2GetIntegerStatus, const fmi2StatusKind k, fmi2Integer *v)
STUB(fmi2GetStringStatus, const fmi2StatusKind k, fmi2String *v)
