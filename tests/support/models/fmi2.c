/* Makes an FMI 2.0 FMU of a model, for co-simulation and model exchange, that minds the call order. */
#include "fmi2Functions.h"

static fmi2Status fail(Model *m, fmi2Status status, const char *text) {
    const fmi2CallbackFunctions *host = m->host;
    host->logger(host->componentEnvironment, m->name, status, "logStatus", "%s", text);
    return status;
}

#define NEEDS(modes) \
    if (!((modes) >> m->mode & 1)) return fail(m, fmi2Error, "called in the wrong mode")
#define IN(mode) (1 << (mode))

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible,
                              fmi2Boolean logging) {
    Model *m = made(name, type == fmi2ModelExchange);
    (void)guid; (void)resources; (void)visible; (void)logging;
    m->host = (void *)host;
    return m;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance,
                               fmi2Real begin, fmi2Boolean stops, fmi2Real stop) {
    Model *m = c;
    (void)tolerant; (void)tolerance; (void)stops; (void)stop;
    NEEDS(IN(INSTANTIATED));
    set_time(m, begin);
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Model *m = c;
    NEEDS(IN(INSTANTIATED));
    m->mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Model *m = c;
    NEEDS(IN(INITIALIZATION));
    m->mode = m->exchange ? EVENT : STEP;
    if (!m->exchange) settle(m);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    Model *m = c;
    NEEDS(IN(EVENT) | IN(CONTINUOUS) | IN(STEP));
    m->mode = TERMINATED;
    return fmi2OK;
}

#define ACCESS(Name, type, member, CONTINUOUS_TYPE) \
    fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference r[], size_t n, \
                             const type v[]) { \
        Model *m = c; \
        for (size_t i = 0; i < n; i++) { \
            if (!may_set(m, r[i], CONTINUOUS_TYPE)) return fail(m, fmi2Error, "cannot be set now"); \
            m->v[r[i]].member = v[i]; \
        } \
        return fmi2OK; \
    } \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference r[], size_t n, type v[]) { \
        Model *m = c; \
        NEEDS(~IN(INSTANTIATED)); \
        equations(m); \
        for (size_t i = 0; i < n; i++) { \
            if (r[i] >= VARIABLES) return fail(m, fmi2Error, "no such variable"); \
            v[i] = m->v[r[i]].member; \
        } \
        return fmi2OK; \
    }

ACCESS(Real, fmi2Real, Float64, true)
ACCESS(Integer, fmi2Integer, Int32, false)
ACCESS(Boolean, fmi2Boolean, Boolean, false)

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n,
                         const fmi2String v[]) {
    Model *m = c;
    for (size_t i = 0; i < n; i++) {
        if (!may_set(m, r[i], false)) return fail(m, fmi2Error, "cannot be set now");
        snprintf(m->v[r[i]].String, sizeof(Value), "%s", v[i]);
    }
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[]) {
    Model *m = c;
    NEEDS(~IN(INSTANTIATED));
    equations(m);
    for (size_t i = 0; i < n; i++) v[i] = m->v[r[i]].String;
    return fmi2OK;
}

/* Co-simulation */
#ifndef NO_STEPS
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set) {
    Model *m = c;
    (void)no_set;
    NEEDS(IN(STEP));
    if (m->ended) return fail(m, fmi2Error, "a step after it asked for the end");
    equations(m);
    advance(m, time + step);
    return m->ended ? fmi2Discard : fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    *value = ((Model *)c)->time;
    return kind == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    *value = ((Model *)c)->ended;
    return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}
#endif

/* Model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    Model *m = c;
    NEEDS(IN(CONTINUOUS));
    m->mode = EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    Model *m = c;
    NEEDS(IN(EVENT));
    m->again = m->states_changed = m->nominals_changed = false;
    equations(m);
    event(m);
    info->newDiscreteStatesNeeded = m->again;
    info->terminateSimulation = m->ended;
    info->nominalsOfContinuousStatesChanged = m->nominals_changed;
    info->valuesOfContinuousStatesChanged = m->states_changed;
    info->nextEventTimeDefined = !isinf(m->next);
    info->nextEventTime = m->next;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    Model *m = c;
    NEEDS(IN(EVENT));
    if (m->again) return fail(m, fmi2Error, "the event is not done");
    m->mode = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_set, fmi2Boolean *enter,
                                       fmi2Boolean *terminate) {
    Model *m = c;
    (void)no_set;
    NEEDS(IN(CONTINUOUS));
    equations(m);
    *enter = completed(m);
    *terminate = m->ended;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    Model *m = c;
    NEEDS(IN(EVENT) | IN(CONTINUOUS));
    set_time(m, time);
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    Model *m = c;
    NEEDS(IN(CONTINUOUS));
    if (n != STATES) return fail(m, fmi2Error, "another number of states");
    put_states(m, x);
    return fmi2OK;
}

#define VECTOR(Name, modes, count, fill) \
    fmi2Status fmi2Get##Name(fmi2Component c, fmi2Real v[], size_t n) { \
        Model *m = c; \
        NEEDS(modes); \
        if (n != count) return fail(m, fmi2Error, "another number of values"); \
        equations(m); \
        fill; \
        return (fmi2Status)m->status; \
    }
#define LATER (IN(EVENT) | IN(CONTINUOUS))

VECTOR(Derivatives, LATER, STATES, slopes(m, v))
VECTOR(EventIndicators, LATER | IN(INITIALIZATION), INDICATORS, indicators(m, v))
VECTOR(ContinuousStates, LATER | IN(INITIALIZATION), STATES, get_states(m, v))
VECTOR(NominalsOfContinuousStates, LATER, STATES, memcpy(v, m->nominal, n * sizeof(double)))
