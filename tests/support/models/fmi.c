/* Makes an FMU of a model, for co-simulation and model exchange, that minds the call order.
 *
 * FMI is 2 or 3, NAME in braces is its GUID or token. An FMU with NO_STEPS is for model exchange
 * alone; one with NO_LICENCE finds none; one with NO_INSTANCE says why only where it is to log; one
 * that is NEEDY has an event in each step, used or not.
 * AT_INITIALISATION, AT_STEP, AT_TERMINATE and AT_FREE are statements that it does there.
 */
#ifndef AT_INITIALISATION
#define AT_INITIALISATION (void)0
#endif
#ifndef AT_STEP
#define AT_STEP (void)0
#endif
#ifndef AT_TERMINATE
#define AT_TERMINATE (void)0
#endif
#ifndef AT_FREE
#define AT_FREE (void)0
#endif
#ifndef NEEDY
#define NEEDY false
#endif
#if FMI == 2
#include "fmi2Functions.h"
#define F(name) fmi2##name
#define SIZES           /* the number of values behind them */
#define COUNT n
#else
#include "fmi3Functions.h"
#define F(name) fmi3##name
#define SIZES , size_t nv
#define COUNT nv
#endif

typedef F(Boolean) Truth;
typedef F(Status) Status;
typedef F(ValueReference) Reference;

static Status fail(Model *m, Status status, const char *text) {
#if FMI == 2
    const fmi2CallbackFunctions *host = m->host;
    host->logger(host->componentEnvironment, m->name, status, "logStatus", "%s", text);
#else
    if (m->log) ((fmi3LogMessageCallback)m->log)(m->host, status, "logStatus", text);
#endif
    return status;
}

#define IN(mode) (1 << (mode))
#define RUNNING (IN(EVENT) | IN(CONTINUOUS) | IN(STEP))
#define NEEDS(modes) \
    if (!((modes) >> m->mode & 1)) return fail(m, F(Error), "called in the wrong mode")

static Model *made(Model *m, const char *name, const char *token, const char *resources) {
    char wrong[512] = "";

    (void)resources;
    snprintf(m->name, sizeof m->name, "%s", name);
    m->next = INFINITY;
    m->reason = "";
    for (int i = 0; i < ROOM; i++) m->nominal[i] = 1.0;
    if (strcmp(token, "{" NAME "}")) snprintf(wrong, sizeof wrong, "wrong token %s", token);
#ifdef NO_LICENCE
    snprintf(wrong, sizeof wrong, "No license for feature X in %s/key", resources);
#endif
#ifdef NO_INSTANCE
    if (m->logging) snprintf(wrong, sizeof wrong, "no key");
    else {
        free(m);
        return NULL;
    }
#endif
#if FMI == 3
    FILE *folder = fopen(resources, "r");
    if (folder) fclose(folder);
    else snprintf(wrong, sizeof wrong, "resources are not there");
#endif
    if (*wrong) {
        fail(m, F(Error), wrong);
        free(m);
        return NULL;
    }
    start(m);
    return m;
}

#if FMI == 2
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible,
                              fmi2Boolean logging) {
    Model *m = calloc(1, sizeof(Model));
    (void)visible;
    m->logging = logging;
    m->exchange = type == fmi2ModelExchange;
    m->early = true;
    m->host = (void *)host;
    return made(m, name, guid, resources);
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance,
                               fmi2Real begin, fmi2Boolean stops, fmi2Real stop) {
    Model *m = c;
    NEEDS(IN(INSTANTIATED));
    m->tolerance = tolerant ? tolerance : 0.0;
    m->stop = stops ? stop : INFINITY;
    set_time(m, begin);
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
#else
fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early,
    const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment host,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    Model *m = calloc(1, sizeof(Model));
    (void)visible; (void)required; (void)n; (void)update;
    m->logging = logging;
    m->early = early;
    m->events = event_mode;
    m->host = host;
    m->log = (void *)log;
    return made(m, name, token, resources);
}

fmi3Instance fmi3InstantiateModelExchange(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment host, fmi3LogMessageCallback log) {
    Model *m = fmi3InstantiateCoSimulation(name, token, resources, visible, logging, false, false,
                                           NULL, 0, host, log, NULL);
    if (m) m->exchange = true;
    return m;
}

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
    Model *m = c;
    NEEDS(IN(INSTANTIATED));
    m->mode = CONFIGURING;
    return fmi3OK;
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
    Model *m = c;
    NEEDS(IN(CONFIGURING));
    if (refusal(m)) return fail(m, fmi3Error, refusal(m));
    m->mode = INSTANTIATED;
    start(m);
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerant, fmi3Float64 tolerance,
                                       fmi3Float64 begin, fmi3Boolean stops, fmi3Float64 stop) {
    ((Model *)c)->tolerance = tolerant ? tolerance : 0.0;
    ((Model *)c)->stop = stops ? stop : INFINITY;
    set_time(c, begin);
#endif
    Model *m = c;
    NEEDS(IN(INSTANTIATED));
    if (refusal(m)) return fail(m, F(Error), refusal(m));
    m->mode = INITIALIZATION;
    AT_INITIALISATION;
    return F(OK);
}

Status F(ExitInitializationMode)(void *c) {
    Model *m = c;
    NEEDS(IN(INITIALIZATION));
    equations(m);
    m->mode = m->exchange || m->events ? EVENT : STEP;
    if (m->mode == STEP) settle(m);
    return F(OK);
}

Status F(Terminate)(void *c) {
    Model *m = c;
    NEEDS(RUNNING);
    m->mode = TERMINATED;
    AT_TERMINATE;
    return F(OK);
}

void F(FreeInstance)(void *c) {
    AT_FREE;
    free(c);
}

/* Values: to and from are what is done with the element e. */

#define ACCESS(Name, continuous, to, from) \
    Status F(Set##Name)(void *c, const Reference r[], size_t n, const F(Name) v[] SIZES) { \
        Model *m = c; \
        size_t at = 0; \
        for (size_t i = 0; i < n; i++) { \
            if (!may_set(m, r[i], continuous)) return fail(m, F(Error), "cannot be set now"); \
            for (size_t k = 0; k < (size_t)SIZE(r[i]); k++, at++) { \
                Value *e = &m->v[r[i]][k]; \
                if (at == COUNT) return fail(m, F(Error), "too few values"); \
                to; \
            } \
        } \
        return at == COUNT ? F(OK) : fail(m, F(Error), "too many values"); \
    } \
    Status F(Get##Name)(void *c, const Reference r[], size_t n, F(Name) v[] SIZES) { \
        Model *m = c; \
        size_t at = 0; \
        NEEDS(RUNNING | IN(INITIALIZATION) | IN(TERMINATED)); \
        equations(m); \
        for (size_t i = 0; i < n; i++) { \
            if (r[i] >= VARIABLES) return fail(m, F(Error), "no such variable"); \
            for (size_t k = 0; k < (size_t)SIZE(r[i]); k++, at++) { \
                Value *e = &m->v[r[i]][k]; \
                if (at == COUNT) return fail(m, F(Error), "too little room"); \
                from; \
            } \
        } \
        return at == COUNT ? F(OK) : fail(m, F(Error), "too much room"); \
    }
#define NUMBER(Name, member, continuous) ACCESS(Name, continuous, e->member = v[at], v[at] = e->member)

#if FMI == 2
NUMBER(Real, Float64, true)
NUMBER(Integer, Int32, false)
#else
NUMBER(Float64, Float64, true)
NUMBER(Float32, Float32, true)
NUMBER(Int8, Int8, false)
NUMBER(UInt8, UInt8, false)
NUMBER(Int16, Int16, false)
NUMBER(UInt16, UInt16, false)
NUMBER(Int32, Int32, false)
NUMBER(UInt32, UInt32, false)
NUMBER(Int64, Int64, false)
NUMBER(UInt64, UInt64, false)
#endif
NUMBER(Boolean, Boolean, false)
ACCESS(String, false, snprintf(e->String, sizeof *e, "%s", v[at]), v[at] = e->String)

#if FMI == 3
fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                         const size_t sizes[], const fmi3Binary v[], size_t nv) {
    Model *m = c;
    (void)nv;
    for (size_t i = 0; i < n; i++) {
        if (!may_set(m, r[i], false)) return fail(m, fmi3Error, "cannot be set now");
        m->binary = sizes[i] < sizeof(Value) ? sizes[i] : sizeof(Value);
        memcpy(m->v[r[i]]->String, v[i], m->binary);
    }
    return fmi3OK;
}

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n, size_t sizes[],
                         fmi3Binary v[], size_t nv) {
    Model *m = c;
    (void)nv;
    equations(m);
    for (size_t i = 0; i < n; i++) {
        sizes[i] = m->binary;
        v[i] = (fmi3Binary)m->v[r[i]]->String;
    }
    return fmi3OK;
}
#endif

/* Co-simulation */

#ifndef NO_STEPS
static Status step_to(Model *m, double time, double step) {
    NEEDS(IN(STEP));
    if (m->ended) return fail(m, F(Error), "a step after it asked for the end");
    set_time(m, time);
    m->status = F(OK);
    m->length = step;
    equations(m);
    advance(m, time + step);
    AT_STEP;
    return m->status && m->reason ? fail(m, m->status, m->reason) : (Status)m->status;
}

#if FMI == 2
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set) {
    Model *m = c;
    Status status = step_to(m, time, step);
    (void)no_set;
    return status ? status : m->ended || m->time < time + step ? fmi2Discard : fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    *value = ((Model *)c)->time;
    return kind == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    *value = ((Model *)c)->ended;
    return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}
#else
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set,
                      fmi3Boolean *needed, fmi3Boolean *terminate, fmi3Boolean *early,
                      fmi3Float64 *last) {
    Model *m = c;
    Status status = step_to(m, time, step);
    (void)no_set;
    *needed = *terminate = *early = false;
    if (status) return status;
    *needed = m->needed || NEEDY;
    *terminate = m->ended;
    *early = m->time < time + step;
    *last = m->time;
    return fmi3OK;
}
#endif
#endif

/* Model exchange, and events of co-simulation */

Status F(EnterEventMode)(void *c) {
    Model *m = c;
    NEEDS(IN(CONTINUOUS) | (m->events ? IN(STEP) : 0));
    m->mode = EVENT;
    m->needed = false;
    return F(OK);
}

#if FMI == 3
fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    Model *m = c;
    NEEDS(IN(EVENT));
    if (m->again) return fail(m, fmi3Error, "the event is not done");
    m->mode = STEP;
    return fmi3OK;
}
#endif

Status F(EnterContinuousTimeMode)(void *c) {
    Model *m = c;
    NEEDS(IN(EVENT));
    if (m->again) return fail(m, F(Error), "the event is not done");
    m->mode = CONTINUOUS;
    return F(OK);
}

static Status iterate(Model *m) {
    NEEDS(IN(EVENT));
    m->again = m->states_changed = m->nominals_changed = false;
    equations(m);
    event(m);
    m->ticking = 0;
    return F(OK);
}

#if FMI == 2
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    Model *m = c;
    Status status = iterate(m);
    info->newDiscreteStatesNeeded = m->again;
    info->terminateSimulation = m->ended;
    info->nominalsOfContinuousStatesChanged = m->nominals_changed;
    info->valuesOfContinuousStatesChanged = m->states_changed;
    info->nextEventTimeDefined = !isinf(m->next);
    info->nextEventTime = m->next;
    return status;
}
#else
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *states,
                                    fmi3Boolean *defined, fmi3Float64 *next) {
    Model *m = c;
    Status status = iterate(m);
    *again = m->again;
    *terminate = m->ended;
    *nominals = m->nominals_changed;
    *states = m->states_changed;
    *defined = !isinf(m->next);
    *next = m->next;
    return status;
}

#ifdef CLOCKS
fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                        const fmi3Clock active[]) {
    Model *m = c;
    NEEDS(IN(EVENT));
    for (size_t i = 0; i < n; i++)
        if (active[i]) m->ticking = r[i];
    return fmi3OK;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]) {
    Model *m = c;
    NEEDS(IN(INITIALIZATION) | IN(EVENT));
    for (size_t i = 0; i < n; i++) {
        int qualifier = 0;
        intervals[i] = interval(m, r[i], &qualifier);
        qualifiers[i] = (fmi3IntervalQualifier)qualifier;
    }
    return fmi3OK;
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                                   fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                   fmi3IntervalQualifier qualifiers[]) {
    for (size_t i = 0; i < n; i++) {
        double value;
        fmi3Status status = fmi3GetIntervalDecimal(c, &r[i], 1, &value, &qualifiers[i]);
        if (status) return status;
        counters[i] = (fmi3UInt64)(value * 3000.0 + 0.5);
        resolutions[i] = 3000;
    }
    return fmi3OK;
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                               fmi3Float64 shifts[]) {
    Model *m = c;
    NEEDS(IN(INITIALIZATION));
    for (size_t i = 0; i < n; i++) shifts[i] = shift(m, r[i]);
    return fmi3OK;
}
#endif

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
    Model *m = c;
    (void)m;
    *n = STATES;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) {
    (void)c;
    *n = INDICATORS;
    return fmi3OK;
}
#endif

Status F(Reset)(void *c) {
    Model *m = c, old = *m;

    memset(m, 0, sizeof(Model));
    m->logging = old.logging;
    m->exchange = old.exchange;
    m->early = old.early;
    m->events = old.events;
    m->host = old.host;
    m->log = old.log;
    memcpy(m->name, old.name, sizeof m->name);
    m->next = INFINITY;
    m->reason = "";
    for (int i = 0; i < ROOM; i++) m->nominal[i] = 1.0;
    start(m);
    return F(OK);
}

/* A state is a copy of the whole model, which has no memory beside. */
#if FMI == 2
#define STATES_OF_HOST(action) fmi2##action##FMUstate
#else
#define STATES_OF_HOST(action) fmi3##action##FMUState
#endif

Status STATES_OF_HOST(Get)(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Model));
    memcpy(*state, c, sizeof(Model));
    return F(OK);
}

Status STATES_OF_HOST(Set)(void *c, void *state) {
    memcpy(c, state, sizeof(Model));
    return F(OK);
}

Status STATES_OF_HOST(Free)(void *c, void **state) {
    (void)c;
    free(*state);
    *state = NULL;
    return F(OK);
}

Status F(CompletedIntegratorStep)(void *c, Truth no_set, Truth *enter, Truth *terminate) {
    Model *m = c;
    (void)no_set;
    NEEDS(IN(CONTINUOUS));
    equations(m);
    *enter = completed(m);
    *terminate = m->ended;
    return F(OK);
}

Status F(SetTime)(void *c, double time) {
    Model *m = c;
    NEEDS(IN(EVENT) | IN(CONTINUOUS));
    set_time(m, time);
    return F(OK);
}

Status F(SetContinuousStates)(void *c, const double x[], size_t n) {
    Model *m = c;
    NEEDS(IN(CONTINUOUS));
    if (n != STATES) return fail(m, F(Error), "another number of states");
    put_states(m, x);
    return F(OK);
}

#define VECTOR(name, count, fill) \
    Status F(name)(void *c, double v[], size_t n) { \
        Model *m = c; \
        NEEDS(IN(INITIALIZATION) | IN(EVENT) | IN(CONTINUOUS)); \
        if (n != count) return fail(m, F(Error), "another number of values"); \
        equations(m); \
        fill; \
        return (Status)m->status; \
    }

#if FMI == 2
VECTOR(GetDerivatives, STATES, slopes(m, v))
#else
VECTOR(GetContinuousStateDerivatives, STATES, slopes(m, v))
#endif
VECTOR(GetEventIndicators, INDICATORS, indicators(m, v))
VECTOR(GetContinuousStates, STATES, get_states(m, v))
VECTOR(GetNominalsOfContinuousStates, STATES, memcpy(v, m->nominal, n * sizeof(double)))
