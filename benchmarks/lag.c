/* An FMU for FMI 2.0 with one input u and any number of outputs: x' = u - x, and y[i] = (x + u) / 2.
 *
 * The value reference of u is 0, that of y[i] is i. scaling.py writes the model description.
 */
#include <stddef.h>
#include <stdlib.h>

typedef struct {
    double u, x;
} Lag;

#ifdef _WIN32
#define FMI __declspec(dllexport)
#else
#define FMI
#endif

#define NOTHING(name) \
    FMI int name(void *lag) { (void)lag; return 0; }

FMI const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI const char *fmi2GetVersion(void) { return "2.0"; }

FMI void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources,
                          const void *callbacks, int visible, int logging) {
    Lag *lag = malloc(sizeof *lag);

    (void)name; (void)kind; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
    if (lag) *lag = (Lag){1.0, 1.0};
    return lag;
}

FMI void fmi2FreeInstance(void *lag) { free(lag); }

FMI int fmi2SetupExperiment(void *lag, int has_tolerance, double tolerance, double start, int has_stop,
                            double stop) {
    (void)lag; (void)has_tolerance; (void)tolerance; (void)start; (void)has_stop; (void)stop;
    return 0;
}

NOTHING(fmi2EnterInitializationMode)
NOTHING(fmi2ExitInitializationMode)
NOTHING(fmi2Terminate)

FMI int fmi2Reset(void *lag) {
    *(Lag *)lag = (Lag){1.0, 1.0};
    return 0;
}

FMI int fmi2SetReal(void *lag, const unsigned references[], size_t count, const double values[]) {
    for (size_t i = 0; i < count; i++)
        if (references[i] == 0) ((Lag *)lag)->u = values[i];
    return 0;
}

FMI int fmi2GetReal(void *lag, const unsigned references[], size_t count, double values[]) {
    const Lag *self = lag;

    for (size_t i = 0; i < count; i++)
        values[i] = references[i] ? 0.5 * (self->x + self->u) : self->u;
    return 0;
}

FMI int fmi2DoStep(void *lag, double time, double step, int done) {
    Lag *self = lag;

    (void)time; (void)done;
    self->x += step * (self->u - self->x);
    return 0;
}
