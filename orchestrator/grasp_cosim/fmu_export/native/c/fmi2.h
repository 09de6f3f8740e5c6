/* FMI 2.0 for co-simulation: each function of the standard, in terms of the slave.

   Before it is included: SLAVE, the header of that slave, and what this needs before it. */
#ifndef FMI2_H
#define FMI2_H

#include <stdlib.h>

#include "fmi2Functions.h"

typedef struct {
    fmi2CallbackLogger logger;  /* may be NULL */
    fmi2ComponentEnvironment environment;
    fmi2CallbackAllocateMemory allocate;  /* may be NULL */
    fmi2CallbackFreeMemory release;
} Host;

typedef fmi2Status Status;

#define SLAVE_OK fmi2OK
#define SLAVE_WARNING fmi2Warning
#define SLAVE_DISCARD fmi2Discard
#define SLAVE_ERROR fmi2Error

#define SLAVE_FMI "fmi2"
#define SLAVE_REAL "Real"
#define SLAVE_BOOLEAN "Boolean"
#define SLAVE_INTEGER "Integer"
#define SLAVE_TOKEN "GUID"
#define SLAVE_GET_STATE "GetFMUstate"
#define N_REFERENCES N_VARIABLES

#include SLAVE

/* The host */

/* The message is the format: hosts in Python see no more of it, and for others a % is doubled */
static void slave_log(const Slave *s, Status status)
{
    char format[2 * TEXT_CAPACITY], *to = format;
    const char *from;
    if (!s->host.logger) {
        return;
    }
    for (from = s->said.at; *from; from++) {
        if (*from == '%') {
            *to++ = '%';
        }
        *to++ = *from;
    }
    *to = '\0';
    s->host.logger(s->host.environment, s->name, status, slave_categories[status], format);
}

static void *slave_allocate(const Host *host, size_t size)
{
    return host->allocate ? host->allocate(1, size) : malloc(size);
}

static void slave_release(const Host *host, void *memory)
{
    if (host->allocate) {
        host->release(memory);
    } else {
        free(memory);
    }
}

/* Most functions are a line each, and not all arguments are of use */
#ifdef __GNUC__
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define FMI2_FUNCTION(Name, arguments, result)                                                     \
    fmi2Status fmi2##Name arguments                                                                \
    {                                                                                              \
        return c ? (result) : fmi2Error;                                                           \
    }

#define FMI2_NOT_THERE(Name, arguments)                                                            \
    FMI2_FUNCTION(Name, arguments,                                                                 \
                  slave_refuse(c, "fmi2" #Name ": is not supported by this FMU"))

#define FMI2_REFERENCES fmi2Component c, const fmi2ValueReference vr[], size_t n

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
FMI2_FUNCTION(SetDebugLogging,
              (fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]), fmi2OK)

/* Life cycle */

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean logging)
{
    Host host = {NULL, NULL, NULL, NULL};
    if (functions) {
        host.logger = functions->logger;
        host.environment = functions->componentEnvironment;
        if (functions->allocateMemory && functions->freeMemory) {
            host.allocate = functions->allocateMemory;
            host.release = functions->freeMemory;
        }
    }
    return slave_new(&host, name, guid,
                     type == fmi2CoSimulation
                         ? NULL
                         : "fmi2Instantiate as fmi2ModelExchange: must be fmi2CoSimulation");
}

void fmi2FreeInstance(fmi2Component c)
{
    if (c) {
        slave_free(c);
    }
}

FMI2_FUNCTION(SetupExperiment,
              (fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
               fmi2Boolean has_stop, fmi2Real stop),
              slave_require(c, "SetupExperiment", INSTANTIATED) ? fmi2Error
                                                                : slave_begin_at(c, start))
FMI2_FUNCTION(EnterInitializationMode, (fmi2Component c),
              slave_enter(c, ((const Slave *)c)->values[SLAVE_TIME]))
FMI2_FUNCTION(ExitInitializationMode, (fmi2Component c), slave_exit(c))
FMI2_FUNCTION(Terminate, (fmi2Component c), slave_terminate(c))
FMI2_FUNCTION(Reset, (fmi2Component c), slave_reset(c))

/* Values */

#define FMI2_VALUES(Type)                                                                          \
    FMI2_FUNCTION(Get##Type, (FMI2_REFERENCES, fmi2##Type values[]),                               \
                  slave_get_##Type(c, vr, n, values))                                              \
    FMI2_FUNCTION(Set##Type, (FMI2_REFERENCES, const fmi2##Type values[]),                         \
                  slave_set_##Type(c, vr, n, values))

SLAVE_VALUES(Real, KIND_REAL, fmi2Real)
SLAVE_VALUES(Integer, KIND_INTEGER, fmi2Integer)
SLAVE_VALUES(Boolean, KIND_BOOLEAN, fmi2Boolean)

FMI2_VALUES(Real)
FMI2_VALUES(Integer)
FMI2_VALUES(Boolean)
FMI2_VALUES(String)

/* Not of FMI: the values by their references, where a master in this process may read outputs after
   a step that is OK. It saves the call. They stay there as long as the instance does. */
#if SLAVE_HAS_STATES
FMI2_Export const double *fmi2FullName(graspValues)(fmi2Component c);

const double *fmi2FullName(graspValues)(fmi2Component c)
{
    return ((const Slave *)c)->values;
}
#endif

/* States */

#if SLAVE_HAS_STATES
#define FMI2_OF_STATES FMI2_FUNCTION
#else
#define FMI2_OF_STATES(Name, arguments, result) FMI2_NOT_THERE(Name, arguments)
#endif

FMI2_OF_STATES(GetFMUstate, (fmi2Component c, fmi2FMUstate *state), slave_get_state(c, state))
FMI2_OF_STATES(SetFMUstate, (fmi2Component c, fmi2FMUstate state), slave_set_state(c, state))
FMI2_OF_STATES(FreeFMUstate, (fmi2Component c, fmi2FMUstate *state), slave_free_state(c, state))
FMI2_OF_STATES(SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate state, size_t *size),
               slave_state_size(c, state, size))
FMI2_OF_STATES(SerializeFMUstate,
               (fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size),
               slave_serialise(c, state, bytes, size))
FMI2_OF_STATES(DeSerializeFMUstate,
               (fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state),
               slave_deserialise(c, bytes, size, state))

/* Steps */

FMI2_FUNCTION(DoStep, (fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean no_state_prior),
              slave_do_step(c, time, h))

/* After a step that was discarded: that it is not the end, and how far the slave came */

static Status slave_get_time(const Slave *s, double *time)
{
    *time = s->values[SLAVE_TIME];
    return SLAVE_OK;
}

FMI2_FUNCTION(GetRealStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Real *value),
              kind == fmi2LastSuccessfulTime ? slave_get_time(c, value) : fmi2Discard)
FMI2_FUNCTION(GetBooleanStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value),
              kind == fmi2Terminated ? (*value = fmi2False, fmi2OK) : fmi2Discard)
FMI2_FUNCTION(GetIntegerStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value),
              fmi2Discard)
FMI2_FUNCTION(GetStringStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2String *value),
              fmi2Discard)

/* What the model description says is not there: no step is ever pending, no model exchange */

FMI2_NOT_THERE(CancelStep, (fmi2Component c))
FMI2_NOT_THERE(GetStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Status *value))
FMI2_NOT_THERE(SetRealInputDerivatives,
               (FMI2_REFERENCES, const fmi2Integer order[], const fmi2Real v[]))
FMI2_NOT_THERE(GetRealOutputDerivatives, (FMI2_REFERENCES, const fmi2Integer order[], fmi2Real v[]))
FMI2_NOT_THERE(GetDirectionalDerivative,
               (FMI2_REFERENCES, const fmi2ValueReference known[], size_t n_known,
                const fmi2Real dv_known[], fmi2Real dv[]))
FMI2_NOT_THERE(EnterEventMode, (fmi2Component c))
FMI2_NOT_THERE(NewDiscreteStates, (fmi2Component c, fmi2EventInfo *info))
FMI2_NOT_THERE(EnterContinuousTimeMode, (fmi2Component c))
FMI2_NOT_THERE(CompletedIntegratorStep, (fmi2Component c, fmi2Boolean no_state_prior,
                                         fmi2Boolean *enter_event_mode, fmi2Boolean *terminate))
FMI2_NOT_THERE(SetTime, (fmi2Component c, fmi2Real time))
FMI2_NOT_THERE(SetContinuousStates, (fmi2Component c, const fmi2Real x[], size_t n))
FMI2_NOT_THERE(GetDerivatives, (fmi2Component c, fmi2Real derivatives[], size_t n))
FMI2_NOT_THERE(GetEventIndicators, (fmi2Component c, fmi2Real indicators[], size_t n))
FMI2_NOT_THERE(GetContinuousStates, (fmi2Component c, fmi2Real x[], size_t n))
FMI2_NOT_THERE(GetNominalsOfContinuousStates, (fmi2Component c, fmi2Real nominals[], size_t n))

#ifdef __GNUC__
#pragma GCC diagnostic pop
#endif

#endif
