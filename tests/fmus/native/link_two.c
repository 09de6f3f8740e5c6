/* Two FMUs that are linked into this program, each by its prefix: two runs that do not meet. */
#include <stdio.h>

#include "fmi2FunctionTypes.h"

#define FUNCTIONS(prefix)                                                                          \
    fmi2InstantiateTYPE prefix##fmi2Instantiate;                                                   \
    fmi2EnterInitializationModeTYPE prefix##fmi2EnterInitializationMode;                           \
    fmi2ExitInitializationModeTYPE prefix##fmi2ExitInitializationMode;                             \
    fmi2SetRealTYPE prefix##fmi2SetReal;                                                           \
    fmi2GetRealTYPE prefix##fmi2GetReal;                                                           \
    fmi2DoStepTYPE prefix##fmi2DoStep;                                                             \
    fmi2FreeInstanceTYPE prefix##fmi2FreeInstance;                                                 \
    static int prefix##run(double force, double *position)                                         \
    {                                                                                              \
        const fmi2ValueReference in = 0, out = 2;                                                  \
        fmi2Component c = prefix##fmi2Instantiate("one", fmi2CoSimulation, GUID, 0, 0, 0, 0);      \
        int bad = !c || prefix##fmi2SetReal(c, &in, 1, &force)                                     \
                  || prefix##fmi2EnterInitializationMode(c)                                        \
                  || prefix##fmi2ExitInitializationMode(c) || prefix##fmi2DoStep(c, 0, 0.5, 1)     \
                  || prefix##fmi2GetReal(c, &out, 1, position);                                    \
        prefix##fmi2FreeInstance(c);                                                               \
        return bad;                                                                                \
    }

FUNCTIONS(HandWritten_)
FUNCTIONS(Other_)

int main(void)
{
    double one, other;
    if (HandWritten_run(1.0, &one) || Other_run(2.0, &other)) {
        return 1;
    }
    printf("%g %g\n", one, other);
    return 0;
}
