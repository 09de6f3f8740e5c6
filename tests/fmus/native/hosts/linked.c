/* A program that two kinds of FMUs are linked into from their sources, as real-time targets do: the
   closed loop of the grasp, with a plant, two sensors and a controller.

     -DPLANT=Name_fmi2 -DSENSOR=... -DCONTROLLER=...      what their functions begin with
     -DPLANT_TOKEN="..." and so on

   Prints the plant's first two outputs after each step, as bits. */
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

#define JOINED(prefix, name) prefix##name
#define NAMED(prefix, name) JOINED(prefix, name)

#define DECLARE(prefix)                                                                            \
    extern fmi2InstantiateTYPE NAMED(prefix, Instantiate);                                         \
    extern fmi2SetupExperimentTYPE NAMED(prefix, SetupExperiment);                                 \
    extern fmi2EnterInitializationModeTYPE NAMED(prefix, EnterInitializationMode);                 \
    extern fmi2ExitInitializationModeTYPE NAMED(prefix, ExitInitializationMode);                   \
    extern fmi2SetRealTYPE NAMED(prefix, SetReal);                                                 \
    extern fmi2GetRealTYPE NAMED(prefix, GetReal);                                                 \
    extern fmi2DoStepTYPE NAMED(prefix, DoStep);                                                   \
    extern fmi2FreeInstanceTYPE NAMED(prefix, FreeInstance);

DECLARE(PLANT)
DECLARE(SENSOR)
DECLARE(CONTROLLER)

static int bad;

static void put(double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    printf("%08lx%08lx ", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xffffffffu));
}

#define BEGIN(prefix, c, token)                                                                    \
    c = NAMED(prefix, Instantiate)(#c, fmi2CoSimulation, token, NULL, NULL, 0, 0);                 \
    bad |= !c || NAMED(prefix, SetupExperiment)(c, 0, 0.0, 0.0, 0, 0.0)                            \
           || NAMED(prefix, EnterInitializationMode)(c)
#define SET(prefix, c, first, n, values)                                                           \
    bad |= NAMED(prefix, SetReal)(c, references + (first), n, values)
#define GET(prefix, c, first, n, values)                                                           \
    bad |= NAMED(prefix, GetReal)(c, references + (first), n, values)

int main(void)
{
    static const fmi2ValueReference references[] = {0, 1, 2, 3, 4, 5, 6, 7};
    fmi2Component plant, first, second, controller;
    double force[2] = {0.0, 0.0}, seen[6], u[6];
    int k;
    BEGIN(PLANT, plant, PLANT_TOKEN);
    BEGIN(SENSOR, first, SENSOR_TOKEN);
    BEGIN(SENSOR, second, SENSOR_TOKEN);
    BEGIN(CONTROLLER, controller, CONTROLLER_TOKEN);
    for (k = -1; k < 500 && !bad; k++) {
        double t = k * 1e-3, h = 1e-3;
        if (k >= 0) {
            SET(PLANT, plant, 0, 2, force);
            bad |= NAMED(PLANT, DoStep)(plant, t, h, 1);
        }
        GET(PLANT, plant, 2, 6, seen);  /* position, velocity, gap */
        SET(SENSOR, first, 0, 1, &seen[4]);
        SET(SENSOR, second, 0, 1, &seen[5]);
        if (k >= 0) {
            bad |= NAMED(SENSOR, DoStep)(first, t, h, 1) || NAMED(SENSOR, DoStep)(second, t, h, 1);
        }
        memcpy(u, seen, 4 * sizeof *u);
        GET(SENSOR, first, 1, 1, &u[4]);
        GET(SENSOR, second, 1, 1, &u[5]);
        SET(CONTROLLER, controller, 0, 6, u);
        if (k >= 0) {
            bad |= NAMED(CONTROLLER, DoStep)(controller, t, h, 1);
        } else {
            bad |= NAMED(PLANT, ExitInitializationMode)(plant)
                   || NAMED(SENSOR, ExitInitializationMode)(first)
                   || NAMED(SENSOR, ExitInitializationMode)(second)
                   || NAMED(CONTROLLER, ExitInitializationMode)(controller);
        }
        GET(CONTROLLER, controller, 6, 2, force);
        put(seen[0]), put(seen[1]);
        printf("\n");
    }
    NAMED(PLANT, FreeInstance)(plant);
    NAMED(SENSOR, FreeInstance)(first);
    NAMED(SENSOR, FreeInstance)(second);
    NAMED(CONTROLLER, FreeInstance)(controller);
    return bad;
}
