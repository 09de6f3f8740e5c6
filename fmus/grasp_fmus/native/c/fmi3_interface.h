/* FMI 3.0 for co-simulation: each function of the standard, in terms of the slave, which is included before. */
#ifndef FMI3_INTERFACE_H
#define FMI3_INTERFACE_H

static const char *const fmi3_categories[] = {"", "logStatusWarning", "logStatusDiscard",
                                              "logStatusError"};

static void slave_log(const Slave *s, Status status)
{
    if (s->host.logger) {
        s->host.logger(s->host.environment, status, fmi3_categories[status], s->text);
    }
}

/* A call that this FMU has no use for */
static fmi3Status fmi3_not_supported(fmi3Instance instance, const char *text)
{
    return instance ? slave_refuse((Slave *)instance, text) : fmi3Error;
}

#define FMI3_INSTANCE(instance)                                                                    \
    Slave *s = (Slave *)(instance);                                                                \
    if (!s) {                                                                                      \
        return fmi3Error;                                                                          \
    }

/* Inquiry */

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

/* What is said is said in any case: it is the reason of a refusal, once */
fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[])
{
    (void)loggingOn, (void)nCategories, (void)categories;
    return instance ? fmi3OK : fmi3Error;
}

/* Life cycle */

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate)
{
    const char *name = instanceName ? instanceName : "";
    Slave *s = (Slave *)calloc(1, slave_size(name));
    Host host;
    Status status;
    (void)resourcePath;  /* nothing is read from there */
    (void)visible, (void)loggingOn, (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables, (void)nRequiredIntermediateVariables;
    (void)intermediateUpdate;
    if (!s) {
        return NULL;
    }
    host.logger = logMessage;
    host.environment = instanceEnvironment;
    status = slave_instantiate(s, &host, name, instantiationToken);
    if (status == SLAVE_OK && eventModeUsed) {
        status = slave_refuse(s, "eventModeUsed = true: must be false, there are no events");
    }
    if (status != SLAVE_OK) {
        free(s);
        return NULL;
    }
    return s;
}

static fmi3Instance fmi3_no_instance(fmi3InstanceEnvironment environment,
                                     fmi3LogMessageCallback logger, const char *text)
{
    if (logger) {
        logger(environment, fmi3Error, fmi3_categories[fmi3Error], text);
    }
    return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage)
{
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible;
    (void)loggingOn;
    return fmi3_no_instance(instanceEnvironment, logMessage,
                            "fmi3InstantiateModelExchange: must be fmi3InstantiateCoSimulation");
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
    fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption)
{
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible;
    (void)loggingOn, (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    return fmi3_no_instance(
        instanceEnvironment, logMessage,
        "fmi3InstantiateScheduledExecution: must be fmi3InstantiateCoSimulation");
}

void fmi3FreeInstance(fmi3Instance instance)
{
    if (instance) {
        slave_end((Slave *)instance);
    }
    free(instance);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    FMI3_INSTANCE(instance)
    Status status;
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    if (slave_require(s, "EnterInitializationMode", INSTANTIATED) != SLAVE_OK
        || slave_begin_at(s, startTime) != SLAVE_OK) {
        return fmi3Error;
    }
    status = slave_enter_initialisation(s);
    if (status != SLAVE_OK) {
        s->values[SLAVE_TIME] = 0.0;  /* as before: only this call sets it */
    }
    return status;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    FMI3_INSTANCE(instance)
    if (slave_require(s, "ExitInitializationMode", INITIALISING) != SLAVE_OK) {
        return fmi3Error;
    }
    return slave_go_on(s);
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    FMI3_INSTANCE(instance)
    slave_end(s);
    s->phase = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    FMI3_INSTANCE(instance)
    slave_end(s);
    return slave_start(s);
}

/* Values. All variables are scalars: there are as many values as references. */

static fmi3Status fmi3_refuse_count(Slave *s)
{
    return slave_refuse(s, "as many values as value references: must be so, all are scalars");
}

#define FMI3_VALUES_OF(Type, kind, from)                                                           \
    fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[],    \
                             size_t nValueReferences, fmi3##Type values[], size_t nValues)         \
    {                                                                                              \
        FMI3_INSTANCE(instance)                                                                    \
        if (nValues != nValueReferences) {                                                         \
            return fmi3_refuse_count(s);                                                           \
        }                                                                                          \
        {                                                                                          \
            SLAVE_GET(valueReferences, nValueReferences, kind, values[i], fmi3##Type)              \
        }                                                                                          \
        return fmi3OK;                                                                             \
    }                                                                                              \
                                                                                                   \
    fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[],    \
                             size_t nValueReferences, const fmi3##Type values[], size_t nValues)   \
    {                                                                                              \
        FMI3_INSTANCE(instance)                                                                    \
        if (nValues != nValueReferences) {                                                         \
            return fmi3_refuse_count(s);                                                           \
        }                                                                                          \
        {                                                                                          \
            SLAVE_SET(valueReferences, nValueReferences, kind, from)                               \
        }                                                                                          \
        return fmi3OK;                                                                             \
    }

FMI3_VALUES_OF(Float64, KIND_REAL, values[i])
FMI3_VALUES_OF(Int32, KIND_INTEGER, values[i])
FMI3_VALUES_OF(Int64, KIND_INTEGER, values[i])
FMI3_VALUES_OF(Boolean, KIND_BOOLEAN, values[i])

/* The types that no variable has */
#define FMI3_NONE_OF(Type)                                                                         \
    fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[],    \
                             size_t nValueReferences, fmi3##Type values[], size_t nValues)         \
    {                                                                                              \
        FMI3_INSTANCE(instance)                                                                    \
        (void)values, (void)nValues;                                                               \
        return slave_refuse_type(s, valueReferences, nValueReferences, #Type);                     \
    }                                                                                              \
                                                                                                   \
    fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[],    \
                             size_t nValueReferences, const fmi3##Type values[], size_t nValues)   \
    {                                                                                              \
        FMI3_INSTANCE(instance)                                                                    \
        (void)values, (void)nValues;                                                               \
        return slave_refuse_type(s, valueReferences, nValueReferences, #Type);                     \
    }

FMI3_NONE_OF(Float32)
FMI3_NONE_OF(Int8)
FMI3_NONE_OF(UInt8)
FMI3_NONE_OF(Int16)
FMI3_NONE_OF(UInt16)
FMI3_NONE_OF(UInt32)
FMI3_NONE_OF(UInt64)

fmi3Status fmi3GetString(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, fmi3String values[], size_t nValues)
{
    FMI3_INSTANCE(instance)
    if (nValues != nValueReferences) {
        return fmi3_refuse_count(s);
    }
    return slave_get_strings(s, valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetString(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, const fmi3String values[], size_t nValues)
{
    FMI3_INSTANCE(instance)
    if (nValues != nValueReferences) {
        return fmi3_refuse_count(s);
    }
    return slave_set_strings(s, valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, size_t valueSizes[], fmi3Binary values[],
                         size_t nValues)
{
    FMI3_INSTANCE(instance)
    (void)valueSizes, (void)values, (void)nValues;
    return slave_refuse_type(s, valueReferences, nValueReferences, "Binary");
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, const size_t valueSizes[],
                         const fmi3Binary values[], size_t nValues)
{
    FMI3_INSTANCE(instance)
    (void)valueSizes, (void)values, (void)nValues;
    return slave_refuse_type(s, valueReferences, nValueReferences, "Binary");
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, fmi3Clock values[])
{
    FMI3_INSTANCE(instance)
    (void)values;
    return slave_refuse_type(s, valueReferences, nValueReferences, "Clock");
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, const fmi3Clock values[])
{
    FMI3_INSTANCE(instance)
    (void)values;
    return slave_refuse_type(s, valueReferences, nValueReferences, "Clock");
}

/* States */

#if SLAVE_HAS_STATES

/* A state that is there already, of an earlier call, is used again */
fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    FMI3_INSTANCE(instance)
    if (*FMUState && slave_check_state(s, (Snapshot *)*FMUState) != SLAVE_OK) {
        return fmi3Error;
    }
    if (!*FMUState) {
        *FMUState = calloc(1, sizeof(Snapshot));
    }
    if (!*FMUState) {
        return slave_refuse(s, "fmi3GetFMUState: there is no memory");
    }
    slave_save(s, (Snapshot *)*FMUState);
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    FMI3_INSTANCE(instance)
    return slave_restore(s, (Snapshot *)FMUState);
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    FMI3_INSTANCE(instance)
    if (!FMUState || !*FMUState) {
        return fmi3OK;
    }
    if (slave_check_state(s, (Snapshot *)*FMUState) != SLAVE_OK) {
        return fmi3Error;
    }
    slave_forget((Snapshot *)*FMUState);
    free(*FMUState);
    *FMUState = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    FMI3_INSTANCE(instance)
    *size = SLAVE_STATE_SIZE;
    return slave_check_state(s, (Snapshot *)FMUState);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState,
                                 fmi3Byte serializedState[], size_t size)
{
    FMI3_INSTANCE(instance)
    return slave_serialise(s, (Snapshot *)FMUState, serializedState, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[],
                                   size_t size, fmi3FMUState *FMUState)
{
    FMI3_INSTANCE(instance)
    Snapshot *state = (Snapshot *)calloc(1, sizeof(Snapshot));
    Status status;
    if (!state) {
        return slave_refuse(s, "fmi3DeserializeFMUState: there is no memory");
    }
    status = slave_deserialise(s, serializedState, size, state);
    if (status == SLAVE_OK) {
        *FMUState = state;
    } else {
        free(state);
    }
    return status;
}

#else

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    (void)FMUState;
    return fmi3_not_supported(instance, SLAVE_NO_STATE("GetFMUState"));
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    (void)FMUState;
    return fmi3_not_supported(instance, SLAVE_NO_STATE("SetFMUState"));
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    (void)FMUState;
    return instance ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    (void)FMUState, (void)size;
    return fmi3_not_supported(instance, SLAVE_NO_STATE("SerializedFMUStateSize"));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState,
        fmi3Byte serializedState[], size_t size)
{
    (void)FMUState, (void)serializedState, (void)size;
    return fmi3_not_supported(instance, SLAVE_NO_STATE("SerializeFMUState"));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size,
        fmi3FMUState *FMUState)
{
    (void)FMUState, (void)serializedState, (void)size;
    return fmi3_not_supported(instance, SLAVE_NO_STATE("DeserializeFMUState"));
}

#endif

/* Steps */

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    FMI3_INSTANCE(instance)
    fmi3Boolean *never[3];
    Status status = slave_do_step(s, currentCommunicationPoint, communicationStepSize);
    int i;
    (void)noSetFMUStatePriorToCurrentPoint;
    never[0] = eventHandlingNeeded;
    never[1] = terminateSimulation;
    never[2] = earlyReturn;
    for (i = 0; i < 3; i++) {
        if (never[i]) {
            *never[i] = fmi3False;
        }
    }
    if (lastSuccessfulTime) {
        *lastSuccessfulTime = s->values[SLAVE_TIME];
    }
    return status;
}

/* What the model description says is not there: derivatives, clocks, events, structural parameters,
   model exchange, scheduled execution */

#define FMI3_NOT_THERE(instance, function)                                                         \
    return fmi3_not_supported(instance, "fmi3" function ": is not supported by this FMU")

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    FMI3_NOT_THERE(instance, "EnterEventMode");
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance,
                                               fmi3ValueReference valueReference,
                                               size_t *nDependencies)
{
    (void)valueReference, (void)nDependencies;
    FMI3_NOT_THERE(instance, "GetNumberOfVariableDependencies");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[],
                                       fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[],
                                       fmi3DependencyKind dependencyKinds[], size_t nDependencies)
{
    (void)dependent, (void)elementIndicesOfDependent, (void)independents,
        (void)elementIndicesOfIndependents, (void)dependencyKinds, (void)nDependencies;
    FMI3_NOT_THERE(instance, "GetVariableDependencies");
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                        size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                        fmi3Float64 sensitivity[], size_t nSensitivity)
{
    (void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns, (void)seed, (void)nSeed,
        (void)sensitivity, (void)nSensitivity;
    FMI3_NOT_THERE(instance, "GetDirectionalDerivative");
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                    size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                    fmi3Float64 sensitivity[], size_t nSensitivity)
{
    (void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns, (void)seed, (void)nSeed,
        (void)sensitivity, (void)nSensitivity;
    FMI3_NOT_THERE(instance, "GetAdjointDerivative");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    FMI3_NOT_THERE(instance, "EnterConfigurationMode");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    FMI3_NOT_THERE(instance, "ExitConfigurationMode");
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[])
{
    (void)valueReferences, (void)nValueReferences, (void)intervals, (void)qualifiers;
    FMI3_NOT_THERE(instance, "GetIntervalDecimal");
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance,
                                   const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions,
        (void)qualifiers;
    FMI3_NOT_THERE(instance, "GetIntervalFraction");
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, fmi3Float64 shifts[])
{
    (void)valueReferences, (void)nValueReferences, (void)shifts;
    FMI3_NOT_THERE(instance, "GetShiftDecimal");
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[])
{
    (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
    FMI3_NOT_THERE(instance, "GetShiftFraction");
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, const fmi3Float64 intervals[])
{
    (void)valueReferences, (void)nValueReferences, (void)intervals;
    FMI3_NOT_THERE(instance, "SetIntervalDecimal");
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance,
                                   const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, const fmi3UInt64 counters[],
                                   const fmi3UInt64 resolutions[])
{
    (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
    FMI3_NOT_THERE(instance, "SetIntervalFraction");
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, const fmi3Float64 shifts[])
{
    (void)valueReferences, (void)nValueReferences, (void)shifts;
    FMI3_NOT_THERE(instance, "SetShiftDecimal");
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, const fmi3UInt64 counters[],
                                const fmi3UInt64 resolutions[])
{
    (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions;
    FMI3_NOT_THERE(instance, "SetShiftFraction");
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    FMI3_NOT_THERE(instance, "EvaluateDiscreteStates");
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime)
{
    (void)discreteStatesNeedUpdate, (void)terminateSimulation,
        (void)nominalsOfContinuousStatesChanged, (void)valuesOfContinuousStatesChanged,
        (void)nextEventTimeDefined, (void)nextEventTime;
    FMI3_NOT_THERE(instance, "UpdateDiscreteStates");
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    FMI3_NOT_THERE(instance, "EnterContinuousTimeMode");
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance,
                                       fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation)
{
    (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
    FMI3_NOT_THERE(instance, "CompletedIntegratorStep");
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    (void)time;
    FMI3_NOT_THERE(instance, "SetTime");
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates)
{
    (void)continuousStates, (void)nContinuousStates;
    FMI3_NOT_THERE(instance, "SetContinuousStates");
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[],
                                  size_t nEventIndicators)
{
    (void)eventIndicators, (void)nEventIndicators;
    FMI3_NOT_THERE(instance, "GetEventIndicators");
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[],
                                   size_t nContinuousStates)
{
    (void)continuousStates, (void)nContinuousStates;
    FMI3_NOT_THERE(instance, "GetContinuousStates");
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[],
                                             size_t nContinuousStates)
{
    (void)nominals, (void)nContinuousStates;
    FMI3_NOT_THERE(instance, "GetNominalsOfContinuousStates");
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators)
{
    (void)nEventIndicators;
    FMI3_NOT_THERE(instance, "GetNumberOfEventIndicators");
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates)
{
    (void)nContinuousStates;
    FMI3_NOT_THERE(instance, "GetNumberOfContinuousStates");
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    FMI3_NOT_THERE(instance, "EnterStepMode");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance,
                                    const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nValues)
{
    (void)valueReferences, (void)nValueReferences, (void)orders, (void)values, (void)nValues;
    FMI3_NOT_THERE(instance, "GetOutputDerivatives");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime)
{
    (void)clockReference, (void)activationTime;
    FMI3_NOT_THERE(instance, "ActivateModelPartition");
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
                                             size_t nContinuousStates)
{
    (void)derivatives, (void)nContinuousStates;
    FMI3_NOT_THERE(instance, "GetContinuousStateDerivatives");
}

#endif
