/* FMI 2.0 for co-simulation: each function of the standard, in terms of the slave, which is included before. */
#ifndef FMI2_INTERFACE_H
#define FMI2_INTERFACE_H

static const char *const fmi2_categories[] = {"", "logStatusWarning", "logStatusDiscard",
                                              "logStatusError"};

static void slave_log(const Slave *s, Status status)
{
    if (s->host.logger) {
        s->host.logger(s->host.environment, s->name, status, fmi2_categories[status], s->text);
    }
}

static void *fmi2_allocate(const Host *host, size_t size)
{
    return host->allocate ? host->allocate(1, size) : calloc(1, size);
}

static void fmi2_release(const Host *host, void *memory)
{
    if (host->allocate) {
        host->release(memory);
    } else {
        free(memory);
    }
}

/* A call that this FMU has no use for */
static fmi2Status fmi2_not_supported(fmi2Component c, const char *text)
{
    return c ? slave_refuse((Slave *)c, text) : fmi2Error;
}

#define FMI2_INSTANCE(c)                                                                           \
    Slave *s = (Slave *)(c);                                                                       \
    if (!s) {                                                                                      \
        return fmi2Error;                                                                          \
    }

/* Inquiry */

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

/* What is said is said in any case: it is the reason of a refusal, once */
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    (void)loggingOn, (void)nCategories, (void)categories;
    return c ? fmi2OK : fmi2Error;
}

/* Life cycle */

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn)
{
    const char *name = instanceName ? instanceName : "";
    Host host = {NULL, NULL, NULL, NULL};
    Slave *s;
    Status status;
    (void)fmuResourceLocation;  /* nothing is read from there */
    (void)visible, (void)loggingOn;
    if (functions) {
        host.logger = functions->logger;
        host.environment = functions->componentEnvironment;
        if (functions->allocateMemory && functions->freeMemory) {
            host.allocate = functions->allocateMemory;
            host.release = functions->freeMemory;
        }
    }
    s = (Slave *)fmi2_allocate(&host, slave_size(name));
    if (!s) {
        return NULL;
    }
    status = slave_instantiate(s, &host, name, fmuGUID);
    if (status == SLAVE_OK && fmuType != fmi2CoSimulation) {
        status = slave_refuse(s, "fmi2Instantiate as fmi2ModelExchange: must be fmi2CoSimulation");
    }
    if (status != SLAVE_OK) {
        fmi2_release(&host, s);
        return NULL;
    }
    return s;
}

void fmi2FreeInstance(fmi2Component c)
{
    if (c) {
        Host host = ((Slave *)c)->host;
        slave_end((Slave *)c);
        fmi2_release(&host, c);
    }
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    FMI2_INSTANCE(c)
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    if (slave_require(s, "SetupExperiment", INSTANTIATED) != SLAVE_OK) {
        return fmi2Error;
    }
    return slave_begin_at(s, startTime);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    FMI2_INSTANCE(c)
    if (slave_require(s, "EnterInitializationMode", INSTANTIATED) != SLAVE_OK) {
        return fmi2Error;
    }
    return slave_enter_initialisation(s);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    FMI2_INSTANCE(c)
    if (slave_require(s, "ExitInitializationMode", INITIALISING) != SLAVE_OK) {
        return fmi2Error;
    }
    return slave_go_on(s);
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    FMI2_INSTANCE(c)
    slave_end(s);
    s->phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    FMI2_INSTANCE(c)
    slave_end(s);
    return slave_start(s);
}

/* Values */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    FMI2_INSTANCE(c)
    SLAVE_GET(vr, nvr, KIND_REAL, value[i], fmi2Real)
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[])
{
    FMI2_INSTANCE(c)
    SLAVE_GET(vr, nvr, KIND_INTEGER, value[i], fmi2Integer)
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[])
{
    FMI2_INSTANCE(c)
    SLAVE_GET(vr, nvr, KIND_BOOLEAN, value[i], fmi2Boolean)
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[])
{
    FMI2_INSTANCE(c)
    return slave_get_strings(s, vr, nvr, value);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[])
{
    FMI2_INSTANCE(c)
    SLAVE_SET(vr, nvr, KIND_REAL, value[i])
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[])
{
    FMI2_INSTANCE(c)
    SLAVE_SET(vr, nvr, KIND_INTEGER, value[i])
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[])
{
    FMI2_INSTANCE(c)
    SLAVE_SET(vr, nvr, KIND_BOOLEAN, value[i] != fmi2False)
    return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[])
{
    FMI2_INSTANCE(c)
    return slave_set_strings(s, vr, nvr, value);
}

/* States */

#if SLAVE_HAS_STATES

/* A state that is there already, of an earlier call, is used again */
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    FMI2_INSTANCE(c)
    if (*FMUstate && slave_check_state(s, (Snapshot *)*FMUstate) != SLAVE_OK) {
        return fmi2Error;
    }
    if (!*FMUstate) {
        *FMUstate = fmi2_allocate(&s->host, sizeof(Snapshot));
    }
    if (!*FMUstate) {
        return slave_refuse(s, "fmi2GetFMUstate: there is no memory");
    }
    slave_save(s, (Snapshot *)*FMUstate);
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    FMI2_INSTANCE(c)
    return slave_restore(s, (Snapshot *)FMUstate);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    FMI2_INSTANCE(c)
    if (!FMUstate || !*FMUstate) {
        return fmi2OK;
    }
    if (slave_check_state(s, (Snapshot *)*FMUstate) != SLAVE_OK) {
        return fmi2Error;
    }
    slave_forget((Snapshot *)*FMUstate);
    fmi2_release(&s->host, *FMUstate);
    *FMUstate = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    FMI2_INSTANCE(c)
    *size = SLAVE_STATE_SIZE;
    return slave_check_state(s, (Snapshot *)FMUstate);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate,
                                 fmi2Byte serializedState[], size_t size)
{
    FMI2_INSTANCE(c)
    return slave_serialise(s, (Snapshot *)FMUstate,
                                       (unsigned char *)serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate)
{
    FMI2_INSTANCE(c)
    Snapshot *state = (Snapshot *)fmi2_allocate(&s->host, sizeof(Snapshot));
    Status status;
    if (!state) {
        return slave_refuse(s, "fmi2DeSerializeFMUstate: there is no memory");
    }
    status = slave_deserialise(s, (const unsigned char *)serializedState, size, state);
    if (status == SLAVE_OK) {
        *FMUstate = state;
    } else {
        fmi2_release(&s->host, state);
    }
    return status;
}

#else

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    (void)FMUstate;
    return fmi2_not_supported(c, SLAVE_NO_STATE("GetFMUstate"));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    (void)FMUstate;
    return fmi2_not_supported(c, SLAVE_NO_STATE("SetFMUstate"));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    (void)FMUstate;
    return c ? fmi2OK : fmi2Error;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    (void)FMUstate, (void)size;
    return fmi2_not_supported(c, SLAVE_NO_STATE("SerializedFMUstateSize"));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate,
        fmi2Byte serializedState[], size_t size)
{
    (void)FMUstate, (void)serializedState, (void)size;
    return fmi2_not_supported(c, SLAVE_NO_STATE("SerializeFMUstate"));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
        fmi2FMUstate *FMUstate)
{
    (void)FMUstate, (void)serializedState, (void)size;
    return fmi2_not_supported(c, SLAVE_NO_STATE("DeSerializeFMUstate"));
}

#endif

/* Steps */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    FMI2_INSTANCE(c)
    (void)noSetFMUStatePriorToCurrentPoint;
    return slave_do_step(s, currentCommunicationPoint, communicationStepSize);
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    return fmi2_not_supported(c, "fmi2CancelStep: no step is ever pending");
}

/* After a step that was discarded: that it is not the end, and how far the slave came */

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)kind, (void)value;
    return fmi2_not_supported(c, "fmi2GetStatus: no step is ever pending");
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    FMI2_INSTANCE(c)
    if (kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = s->values[SLAVE_TIME];
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)kind, (void)value;
    return c ? fmi2Discard : fmi2Error;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    FMI2_INSTANCE(c)
    if (kind != fmi2Terminated) {
        return fmi2Discard;
    }
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    (void)kind, (void)value;
    return c ? fmi2Discard : fmi2Error;
}

/* What the model description says is not there */

#define FMI2_NOT_THERE(c, function)                                                                \
    return fmi2_not_supported(c, "fmi2" function ": is not supported by this FMU")

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[])
{
    (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown;
    (void)dvKnown, (void)dvUnknown;
    FMI2_NOT_THERE(c, "GetDirectionalDerivative");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    FMI2_NOT_THERE(c, "SetRealInputDerivatives");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    FMI2_NOT_THERE(c, "GetRealOutputDerivatives");
}

/* Model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    FMI2_NOT_THERE(c, "EnterEventMode");
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo)
{
    (void)eventInfo;
    FMI2_NOT_THERE(c, "NewDiscreteStates");
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    FMI2_NOT_THERE(c, "EnterContinuousTimeMode");
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation)
{
    (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
    FMI2_NOT_THERE(c, "CompletedIntegratorStep");
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    (void)time;
    FMI2_NOT_THERE(c, "SetTime");
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    (void)x, (void)nx;
    FMI2_NOT_THERE(c, "SetContinuousStates");
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx)
{
    (void)derivatives, (void)nx;
    FMI2_NOT_THERE(c, "GetDerivatives");
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni)
{
    (void)eventIndicators, (void)ni;
    FMI2_NOT_THERE(c, "GetEventIndicators");
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx)
{
    (void)x, (void)nx;
    FMI2_NOT_THERE(c, "GetContinuousStates");
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx)
{
    (void)x_nominal, (void)nx;
    FMI2_NOT_THERE(c, "GetNominalsOfContinuousStates");
}

#endif
