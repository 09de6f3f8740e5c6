/* A host of FMI 2.0 that is not ours, for any platform: host BINARY GUID. It steps a GraspController
   through changing inputs, saves its state half-way, restores it at the end, and steps once more.
   It prints both ends: the status and two outputs, all their digits. */
#include <stdio.h>
#ifdef _WIN32
#include <windows.h>
#define OPEN(path) LoadLibraryA(path)
#define FUNCTION(library, name) ((void *)GetProcAddress(library, name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW)
#define FUNCTION(library, name) dlsym(library, name)
#endif

#include "fmi2Functions.h"

#define STEPS 20000
#define STEP 1e-3

static void logged(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String message, ...)
{
    (void)environment;
    printf("%s %d %s %s\n", name, status, category, message);
}

int main(int count, char **words)
{
    fmi2CallbackFunctions callbacks = {logged, NULL, NULL, NULL, NULL};
    const fmi2ValueReference inputs[] = {0, 1, 2, 3, 4, 5}, outputs[] = {6, 7};
    fmi2Real u[6], y[2];
    fmi2FMUstate state = NULL;
    fmi2Component c;
    int status, i, k, end = 0;
    void *library = count == 3 ? (void *)OPEN(words[1]) : NULL;
    if (!library) {
        printf("does not load\n");
        return 1;
    }
#define GET(name) name##TYPE *name = (name##TYPE *)FUNCTION(library, #name)
    GET(fmi2Instantiate);
    GET(fmi2SetupExperiment);
    GET(fmi2EnterInitializationMode);
    GET(fmi2ExitInitializationMode);
    GET(fmi2SetReal);
    GET(fmi2GetReal);
    GET(fmi2DoStep);
    GET(fmi2GetFMUstate);
    GET(fmi2SetFMUstate);
    GET(fmi2FreeFMUstate);
    GET(fmi2Terminate);
    GET(fmi2FreeInstance);
    c = fmi2Instantiate("c", fmi2CoSimulation, words[2], NULL, &callbacks, fmi2False, fmi2False);
    if (!c) {
        printf("makes no instance\n");
        return 1;
    }
    status = fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    status |= fmi2EnterInitializationMode(c) | fmi2ExitInitializationMode(c);
    for (k = 0; end < 2; k++) {
        if (k == STEPS / 2 && !end)
            status |= fmi2GetFMUstate(c, &state);
        if (k == STEPS) {
            printf("%d %.17g %.17g\n", status, y[0], y[1]);
            status |= fmi2SetFMUstate(c, state);
            k = STEPS / 2;
            end++;
        }
        for (i = 0; i < 6; i++)
            u[i] = 0.01 * ((k * (i + 3)) % 17) - 0.05;
        status |= fmi2SetReal(c, inputs, 6, u);
        status |= fmi2DoStep(c, k * STEP, STEP, fmi2True);
        status |= fmi2GetReal(c, outputs, 2, y);
    }
    status |= fmi2FreeFMUstate(c, &state) | fmi2Terminate(c);
    fmi2FreeInstance(c);
    return status;
}
