/* FMI 2.0 for co-simulation as a slave needs it: its host, its statuses, its words. */
#ifndef FMI2_HOST_H
#define FMI2_HOST_H

#include <stdlib.h>

#include "fmi2Functions.h"

typedef struct {
    fmi2CallbackLogger logger;  /* may be NULL */
    fmi2ComponentEnvironment environment;
    fmi2CallbackAllocateMemory allocate;
    fmi2CallbackFreeMemory release;
} Host;

typedef fmi2Status Status;

#define SLAVE_OK fmi2OK
#define SLAVE_WARNING fmi2Warning
#define SLAVE_DISCARD fmi2Discard
#define SLAVE_ERROR fmi2Error

#define SLAVE_FMI "fmi2"
#define SLAVE_PER_CENT "%%"  /* the logger is a printf */
#define SLAVE_REAL "Real"
#define SLAVE_BOOLEAN "Boolean"
#define SLAVE_INTEGER "Integer"
#define SLAVE_TOKEN "GUID"
#define SLAVE_GET_STATE "GetFMUstate"
#define N_REFERENCES N_VARIABLES

#endif
