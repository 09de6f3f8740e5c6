/* FMI 3.0 for co-simulation: each function of the standard, in terms of the slave.

   Before it is included: SLAVE, the header of that slave, and what this needs before it. */
#ifndef FMI3_H
#define FMI3_H

#include <stdlib.h>

#include "fmi3Functions.h"

typedef struct {
    fmi3LogMessageCallback logger;  /* may be NULL */
    fmi3InstanceEnvironment environment;
} Host;

typedef fmi3Status Status;

#define SLAVE_OK fmi3OK
#define SLAVE_WARNING fmi3Warning
#define SLAVE_DISCARD fmi3Discard
#define SLAVE_ERROR fmi3Error

#define SLAVE_FMI "fmi3"
#define SLAVE_REAL "Float64"
#define SLAVE_BOOLEAN "Boolean"
#define SLAVE_INTEGER "Int32 or Int64"  /* an enumeration is Int64 */
#define SLAVE_TOKEN "instantiation token"
#define SLAVE_GET_STATE "GetFMUState"
#define N_REFERENCES (N_VARIABLES + 1)  /* with the time */

#include SLAVE

/* The host */

static void slave_log(const Slave *s, Status status)
{
    if (s->host.logger) {
        s->host.logger(s->host.environment, status, slave_categories[status], s->said.at);
    }
}

static void *slave_allocate(const Host *host, size_t size)
{
    (void)host;
    return malloc(size);
}

static void slave_release(const Host *host, void *memory)
{
    (void)host;
    free(memory);
}

/* Most functions are a line each, and not all arguments are of use */
#ifdef __GNUC__
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define FMI3_FUNCTION(Name, arguments, result)                                                     \
    fmi3Status fmi3##Name arguments                                                                \
    {                                                                                              \
        return c ? (result) : fmi3Error;                                                           \
    }

#define FMI3_NOT_THERE(Name, arguments)                                                            \
    FMI3_FUNCTION(Name, arguments,                                                                 \
                  slave_refuse(c, "fmi3" #Name ": is not supported by this FMU"))

#define FMI3_REFERENCES fmi3Instance c, const fmi3ValueReference vr[], size_t n

/* Inquiry */

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

/* What is said is said in any case: it is the reason of a refusal, once */
FMI3_FUNCTION(SetDebugLogging,
              (fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]), fmi3OK)

/* Life cycle */

static fmi3Instance fmi3_instantiate(fmi3String name, fmi3String token,
                                     fmi3InstanceEnvironment environment,
                                     fmi3LogMessageCallback logger, const char *refusal)
{
    Host host;
    host.logger = logger;
    host.environment = environment;
    return slave_new(&host, name, token, refusal);
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
    const fmi3ValueReference intermediate[], size_t n, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback logger, fmi3IntermediateUpdateCallback update)
{
    const char *refusal = "eventModeUsed = true: must be false, there are no events";
    return fmi3_instantiate(name, token, environment, logger, event_mode ? refusal : NULL);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback logger)
{
    return fmi3_instantiate(name, token, environment, logger,
                            "fmi3InstantiateModelExchange: must be fmi3InstantiateCoSimulation");
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
    fmi3UnlockPreemptionCallback unlock)
{
    return fmi3_instantiate(
        name, token, environment, logger,
        "fmi3InstantiateScheduledExecution: must be fmi3InstantiateCoSimulation");
}

void fmi3FreeInstance(fmi3Instance c)
{
    if (c) {
        slave_free(c);
    }
}

FMI3_FUNCTION(EnterInitializationMode,
              (fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start,
               fmi3Boolean has_stop, fmi3Float64 stop),
              slave_enter(c, start))
FMI3_FUNCTION(ExitInitializationMode, (fmi3Instance c), slave_exit(c))
FMI3_FUNCTION(Terminate, (fmi3Instance c), slave_terminate(c))
FMI3_FUNCTION(Reset, (fmi3Instance c), slave_reset(c))

/* Values. All variables are scalars: there are as many values as references. */

static Status fmi3_refuse_count(Slave *s)
{
    return slave_refuse(s, "not as many values as value references: all are scalars");
}

#define FMI3_VALUES(Type)                                                                          \
    FMI3_FUNCTION(Get##Type, (FMI3_REFERENCES, fmi3##Type values[], size_t n_values),              \
                  n_values == n ? slave_get_##Type(c, vr, n, values) : fmi3_refuse_count(c))       \
    FMI3_FUNCTION(Set##Type, (FMI3_REFERENCES, const fmi3##Type values[], size_t n_values),        \
                  n_values == n ? slave_set_##Type(c, vr, n, values) : fmi3_refuse_count(c))

SLAVE_VALUES(Float64, KIND_REAL, fmi3Float64)
SLAVE_VALUES(Int32, KIND_INTEGER, fmi3Int32)
SLAVE_VALUES(Int64, KIND_INTEGER, fmi3Int64)
SLAVE_VALUES(Boolean, KIND_BOOLEAN, fmi3Boolean)

FMI3_VALUES(Float64)
FMI3_VALUES(Int32)
FMI3_VALUES(Int64)
FMI3_VALUES(Boolean)
FMI3_VALUES(String)

/* The types that no variable has */

#define FMI3_NONE(Name, Type, arguments)                                                           \
    FMI3_FUNCTION(Name, arguments,                                                                 \
                  n ? slave_refuse_reference(c, vr[0], #Type) : fmi3OK)

#define FMI3_NONE_OF(Type)                                                                         \
    FMI3_NONE(Get##Type, Type, (FMI3_REFERENCES, fmi3##Type v[], size_t nv))       \
    FMI3_NONE(Set##Type, Type, (FMI3_REFERENCES, const fmi3##Type v[], size_t nv))

FMI3_NONE_OF(Float32)
FMI3_NONE_OF(Int8)
FMI3_NONE_OF(UInt8)
FMI3_NONE_OF(Int16)
FMI3_NONE_OF(UInt16)
FMI3_NONE_OF(UInt32)
FMI3_NONE_OF(UInt64)
FMI3_NONE(GetBinary, Binary, (FMI3_REFERENCES, size_t sizes[], fmi3Binary v[], size_t nv))
FMI3_NONE(SetBinary, Binary,
          (FMI3_REFERENCES, const size_t sizes[], const fmi3Binary v[], size_t nv))
FMI3_NONE(GetClock, Clock, (FMI3_REFERENCES, fmi3Clock v[]))
FMI3_NONE(SetClock, Clock, (FMI3_REFERENCES, const fmi3Clock v[]))

/* States */

#if SLAVE_HAS_STATES
#define FMI3_OF_STATES FMI3_FUNCTION
#else
#define FMI3_OF_STATES(Name, arguments, result) FMI3_NOT_THERE(Name, arguments)
#endif

FMI3_OF_STATES(GetFMUState, (fmi3Instance c, fmi3FMUState *state), slave_get_state(c, state))
FMI3_OF_STATES(SetFMUState, (fmi3Instance c, fmi3FMUState state), slave_set_state(c, state))
FMI3_OF_STATES(FreeFMUState, (fmi3Instance c, fmi3FMUState *state), slave_free_state(c, state))
FMI3_OF_STATES(SerializedFMUStateSize, (fmi3Instance c, fmi3FMUState state, size_t *size),
               slave_state_size(c, state, size))
FMI3_OF_STATES(SerializeFMUState,
               (fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size),
               slave_serialise(c, state, bytes, size))
FMI3_OF_STATES(DeserializeFMUState,
               (fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state),
               slave_deserialise(c, bytes, size, state))

/* Steps */

static void fmi3_answer(fmi3Boolean *place)
{
    if (place) {
        *place = fmi3False;
    }
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h, fmi3Boolean no_state_prior,
                      fmi3Boolean *needs_event, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_time)
{
    Status status;
    if (!c) {
        return fmi3Error;
    }
    status = slave_do_step(c, time, h);
    fmi3_answer(needs_event);
    fmi3_answer(terminate);
    fmi3_answer(early_return);
    if (last_time) {
        *last_time = ((const Slave *)c)->values[SLAVE_TIME];
    }
    return status;
}

/* What the model description says is not there: derivatives, clocks, events, structural parameters,
   model exchange, scheduled execution */

FMI3_NOT_THERE(EnterEventMode, (fmi3Instance c))
FMI3_NOT_THERE(EnterStepMode, (fmi3Instance c))
FMI3_NOT_THERE(EnterConfigurationMode, (fmi3Instance c))
FMI3_NOT_THERE(ExitConfigurationMode, (fmi3Instance c))
FMI3_NOT_THERE(GetNumberOfVariableDependencies,
               (fmi3Instance c, fmi3ValueReference reference, size_t *n))
FMI3_NOT_THERE(GetVariableDependencies,
               (fmi3Instance c, fmi3ValueReference dependent, size_t elements[],
                fmi3ValueReference independents[], size_t their_elements[],
                fmi3DependencyKind kinds[], size_t n))
FMI3_NOT_THERE(GetDirectionalDerivative,
               (FMI3_REFERENCES, const fmi3ValueReference known[], size_t n_known,
                const fmi3Float64 seed[], size_t n_seed, fmi3Float64 found[], size_t n_found))
FMI3_NOT_THERE(GetAdjointDerivative,
               (FMI3_REFERENCES, const fmi3ValueReference known[], size_t n_known,
                const fmi3Float64 seed[], size_t n_seed, fmi3Float64 found[], size_t n_found))
FMI3_NOT_THERE(GetOutputDerivatives, (FMI3_REFERENCES, const fmi3Int32 orders[],
                                      fmi3Float64 values[], size_t n_values))
FMI3_NOT_THERE(GetIntervalDecimal, (FMI3_REFERENCES, fmi3Float64 intervals[],
                                    fmi3IntervalQualifier qualifiers[]))
FMI3_NOT_THERE(GetIntervalFraction,
               (FMI3_REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                fmi3IntervalQualifier qualifiers[]))
FMI3_NOT_THERE(GetShiftDecimal, (FMI3_REFERENCES, fmi3Float64 shifts[]))
FMI3_NOT_THERE(GetShiftFraction, (FMI3_REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]))
FMI3_NOT_THERE(SetIntervalDecimal, (FMI3_REFERENCES, const fmi3Float64 intervals[]))
FMI3_NOT_THERE(SetIntervalFraction, (FMI3_REFERENCES, const fmi3UInt64 counters[],
                                     const fmi3UInt64 resolutions[]))
FMI3_NOT_THERE(SetShiftDecimal, (FMI3_REFERENCES, const fmi3Float64 shifts[]))
FMI3_NOT_THERE(SetShiftFraction, (FMI3_REFERENCES, const fmi3UInt64 counters[],
                                  const fmi3UInt64 resolutions[]))
FMI3_NOT_THERE(EvaluateDiscreteStates, (fmi3Instance c))
FMI3_NOT_THERE(UpdateDiscreteStates,
               (fmi3Instance c, fmi3Boolean *needs_update, fmi3Boolean *terminate,
                fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
                fmi3Boolean *has_next_time, fmi3Float64 *next_time))
FMI3_NOT_THERE(EnterContinuousTimeMode, (fmi3Instance c))
FMI3_NOT_THERE(CompletedIntegratorStep, (fmi3Instance c, fmi3Boolean no_state_prior,
                                         fmi3Boolean *enter_event_mode, fmi3Boolean *terminate))
FMI3_NOT_THERE(SetTime, (fmi3Instance c, fmi3Float64 time))
FMI3_NOT_THERE(SetContinuousStates, (fmi3Instance c, const fmi3Float64 x[], size_t n))
FMI3_NOT_THERE(GetContinuousStateDerivatives, (fmi3Instance c, fmi3Float64 dx[], size_t n))
FMI3_NOT_THERE(GetEventIndicators, (fmi3Instance c, fmi3Float64 indicators[], size_t n))
FMI3_NOT_THERE(GetContinuousStates, (fmi3Instance c, fmi3Float64 x[], size_t n))
FMI3_NOT_THERE(GetNominalsOfContinuousStates, (fmi3Instance c, fmi3Float64 nominals[], size_t n))
FMI3_NOT_THERE(GetNumberOfEventIndicators, (fmi3Instance c, size_t *n))
FMI3_NOT_THERE(GetNumberOfContinuousStates, (fmi3Instance c, size_t *n))
FMI3_NOT_THERE(ActivateModelPartition, (fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time))

#ifdef __GNUC__
#pragma GCC diagnostic pop
#endif

#endif
