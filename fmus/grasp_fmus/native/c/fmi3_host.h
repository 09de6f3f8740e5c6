/* FMI 3.0 for co-simulation as a slave needs it: its host, its statuses, its words. */
#ifndef FMI3_HOST_H
#define FMI3_HOST_H

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
#define SLAVE_PER_CENT "%"
#define SLAVE_REAL "Float64"
#define SLAVE_BOOLEAN "Boolean"
#define SLAVE_INTEGER "Int32 or Int64"  /* an enumeration is Int64 */
#define SLAVE_TOKEN "instantiation token"
#define SLAVE_GET_STATE "GetFMUState"
#define N_REFERENCES (N_VARIABLES + 1)  /* with the time */

#endif
