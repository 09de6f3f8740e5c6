/* Makes an FMI 3.0 FMU of a model, for co-simulation and model exchange, that minds the call order. */
#include "fmi3Functions.h"

static fmi3Status fail(Model *m, fmi3Status status, const char *text) {
    if (m->log) ((fmi3LogMessageCallback)m->log)(m->host, status, "logStatus", text);
    return status;
}

#define NEEDS(modes) \
    if (!((modes) >> m->mode & 1)) return fail(m, fmi3Error, "called in the wrong mode")
#define IN(mode) (1 << (mode))

static Model *instance_of(fmi3String name, bool exchange, void *host, fmi3LogMessageCallback log) {
    Model *m = made(name, exchange);
    m->host = host;
    m->log = (void *)log;
    return m;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early,
    const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment host,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)token; (void)resources; (void)visible; (void)logging; (void)event_mode; (void)early;
    (void)required; (void)n; (void)update;
    return instance_of(name, false, host, log);
}

fmi3Instance fmi3InstantiateModelExchange(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment host, fmi3LogMessageCallback log) {
    (void)token; (void)resources; (void)visible; (void)logging;
    return instance_of(name, true, host, log);
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }
const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerant, fmi3Float64 tolerance,
                                       fmi3Float64 begin, fmi3Boolean stops, fmi3Float64 stop) {
    Model *m = c;
    (void)tolerant; (void)tolerance; (void)stops; (void)stop;
    NEEDS(IN(INSTANTIATED));
    set_time(m, begin);
    m->mode = INITIALIZATION;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    Model *m = c;
    NEEDS(IN(INITIALIZATION));
    m->mode = m->exchange ? EVENT : STEP;
    if (!m->exchange) settle(m);
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) {
    Model *m = c;
    NEEDS(IN(EVENT) | IN(CONTINUOUS) | IN(STEP));
    m->mode = TERMINATED;
    return fmi3OK;
}

#define ACCESS(Name, CONTINUOUS_TYPE) \
    fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference r[], size_t n, \
                             const fmi3##Name v[], size_t nv) { \
        Model *m = c; \
        if (n != nv) return fail(m, fmi3Error, "sizes differ"); \
        for (size_t i = 0; i < n; i++) { \
            if (!may_set(m, r[i], CONTINUOUS_TYPE)) return fail(m, fmi3Error, "cannot be set now"); \
            m->v[r[i]].Name = v[i]; \
        } \
        return fmi3OK; \
    } \
    fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference r[], size_t n, \
                             fmi3##Name v[], size_t nv) { \
        Model *m = c; \
        NEEDS(~IN(INSTANTIATED)); \
        if (n != nv) return fail(m, fmi3Error, "sizes differ"); \
        equations(m); \
        for (size_t i = 0; i < n; i++) { \
            if (r[i] >= VARIABLES) return fail(m, fmi3Error, "no such variable"); \
            v[i] = m->v[r[i]].Name; \
        } \
        return fmi3OK; \
    }

ACCESS(Float64, true)
ACCESS(Float32, true)
ACCESS(Int8, false)
ACCESS(UInt8, false)
ACCESS(Int16, false)
ACCESS(UInt16, false)
ACCESS(Int32, false)
ACCESS(UInt32, false)
ACCESS(Int64, false)
ACCESS(UInt64, false)
ACCESS(Boolean, false)

fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                         const fmi3String v[], size_t nv) {
    Model *m = c;
    (void)nv;
    for (size_t i = 0; i < n; i++) {
        if (!may_set(m, r[i], false)) return fail(m, fmi3Error, "cannot be set now");
        snprintf(m->v[r[i]].String, sizeof(Value), "%s", v[i]);
    }
    return fmi3OK;
}

fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3String v[],
                         size_t nv) {
    Model *m = c;
    (void)nv;
    NEEDS(~IN(INSTANTIATED));
    equations(m);
    for (size_t i = 0; i < n; i++) v[i] = m->v[r[i]].String;
    return fmi3OK;
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                         const size_t sizes[], const fmi3Binary v[], size_t nv) {
    Model *m = c;
    (void)nv;
    for (size_t i = 0; i < n; i++) {
        if (!may_set(m, r[i], false)) return fail(m, fmi3Error, "cannot be set now");
        m->binary = sizes[i] < sizeof(Value) ? sizes[i] : sizeof(Value);
        memcpy(m->v[r[i]].String, v[i], m->binary);
    }
    return fmi3OK;
}

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n, size_t sizes[],
                         fmi3Binary v[], size_t nv) {
    Model *m = c;
    (void)nv;
    NEEDS(~IN(INSTANTIATED));
    equations(m);
    for (size_t i = 0; i < n; i++) {
        sizes[i] = m->binary;
        v[i] = (fmi3Binary)m->v[r[i]].String;
    }
    return fmi3OK;
}

/* Co-simulation */
#ifndef NO_STEPS
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set,
                      fmi3Boolean *needed, fmi3Boolean *terminate, fmi3Boolean *early,
                      fmi3Float64 *last) {
    Model *m = c;
    (void)no_set;
    NEEDS(IN(STEP));
    if (m->ended) return fail(m, fmi3Error, "a step after it asked for the end");
    equations(m);
    advance(m, time + step);
    *needed = false;
    *terminate = m->ended;
    *early = m->time < time + step;
    *last = m->time;
    return fmi3OK;
}
#endif

/* Model exchange */

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    Model *m = c;
    NEEDS(IN(CONTINUOUS));
    m->mode = EVENT;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *states,
                                    fmi3Boolean *defined, fmi3Float64 *next) {
    Model *m = c;
    NEEDS(IN(EVENT));
    m->again = m->states_changed = m->nominals_changed = false;
    equations(m);
    event(m);
    *again = m->again;
    *terminate = m->ended;
    *nominals = m->nominals_changed;
    *states = m->states_changed;
    *defined = !isinf(m->next);
    *next = m->next;
    return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
    Model *m = c;
    NEEDS(IN(EVENT));
    if (m->again) return fail(m, fmi3Error, "the event is not done");
    m->mode = CONTINUOUS;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_set, fmi3Boolean *enter,
                                       fmi3Boolean *terminate) {
    Model *m = c;
    (void)no_set;
    NEEDS(IN(CONTINUOUS));
    equations(m);
    *enter = completed(m);
    *terminate = m->ended;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
    Model *m = c;
    NEEDS(IN(EVENT) | IN(CONTINUOUS));
    set_time(m, time);
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) {
    Model *m = c;
    NEEDS(IN(CONTINUOUS));
    if (n != STATES) return fail(m, fmi3Error, "another number of states");
    put_states(m, x);
    return fmi3OK;
}

#define VECTOR(Name, count, fill) \
    fmi3Status fmi3Get##Name(fmi3Instance c, fmi3Float64 v[], size_t n) { \
        Model *m = c; \
        NEEDS(IN(INITIALIZATION) | IN(EVENT) | IN(CONTINUOUS)); \
        if (n != count) return fail(m, fmi3Error, "another number of values"); \
        equations(m); \
        fill; \
        return (fmi3Status)m->status; \
    }

VECTOR(ContinuousStateDerivatives, STATES, slopes(m, v))
VECTOR(EventIndicators, INDICATORS, indicators(m, v))
VECTOR(ContinuousStates, STATES, get_states(m, v))
VECTOR(NominalsOfContinuousStates, STATES, memcpy(v, m->nominal, n * sizeof(double)))

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
    (void)c;
    *n = STATES;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) {
    (void)c;
    *n = INDICATORS;
    return fmi3OK;
}
