/* A host that calls most of what an FMU has, for checkers of memory. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

static void hear(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                 fmi2String category, fmi2String message, ...)
{
    va_list arguments;
    (void)environment;
    printf("%s %d %s: ", name, (int)status, category);
    va_start(arguments, message);
    vprintf(message, arguments);
    va_end(arguments);
    printf("\n");
}

static void *give(size_t count, size_t size)
{
    void *memory = malloc(count * size);  /* not zeroed, as the standard would have it */
    if (memory) {
        memset(memory, 0xaa, count * size);
    }
    return memory;
}

static void live(const char *name, int own_memory)
{
    const fmi2ValueReference reals[] = {0, 2, 3, 5, 6, 7}, fault = 9, wrong = 99, outputs[] = {2, 3};
    fmi2CallbackFunctions functions;
    fmi2FMUstate state = NULL, other = NULL;
    fmi2Component c;
    fmi2Real values[6];
    fmi2Integer k;
    fmi2Byte bytes[300];
    size_t size = 0, i;
    memset(&functions, 0, sizeof functions);
    functions.logger = hear;
    functions.allocateMemory = own_memory ? give : NULL;
    functions.freeMemory = own_memory ? free : NULL;
    c = fmi2Instantiate(name, fmi2CoSimulation, "another", NULL, &functions, 0, 1);
    c = c ? NULL : fmi2Instantiate(name, fmi2CoSimulation, GUID, NULL, &functions, 0, 1);
    if (!c) {
        exit(1);
    }
    functions.logger = NULL;  /* it has its own copy */
    fmi2GetReal(c, reals, 6, values);
    fmi2SetReal(c, &wrong, 1, values);
    fmi2GetInteger(c, reals, 1, &k);
    fmi2SetupExperiment(c, 0, 0.0, 1.0, 0, 0.0);
    fmi2EnterInitializationMode(c);
    fmi2ExitInitializationMode(c);
    for (k = 0; k < 8; k++) {
        fmi2SetInteger(c, &fault, 1, &k);
        fmi2DoStep(c, 1.0, 1e-3, 1);
        fmi2GetReal(c, outputs, 2, values);
        fmi2DoStep(c, 1.0, 1e300, 1);
        fmi2GetFMUstate(c, &state);
    }
    fmi2SerializedFMUstateSize(c, state, &size);
    fmi2SerializeFMUstate(c, state, bytes, size);
    for (i = 0; i <= size; i++) {
        if (fmi2DeSerializeFMUstate(c, bytes, i, &other) == fmi2OK) {
            fmi2SetFMUstate(c, other);
            fmi2FreeFMUstate(c, &other);
        }
    }
    memset(bytes + 8, 0xff, 200);
    fmi2DeSerializeFMUstate(c, bytes, 300, &other);
    fmi2Reset(c);
    fmi2FreeFMUstate(c, &state);
    fmi2FreeFMUstate(c, &state);
    fmi2SetFMUstate(c, NULL);
    fmi2Terminate(c);
    fmi2FreeInstance(c);
}

int main(void)
{
    char name[2001];
    memset(name, '\xff', 2000);
    name[2000] = '\0';
    live("one", 0);
    live("50 %s %n", 1);
    live(name, 1);
    live("", 0);
    printf("done\n");
    return 0;
}
