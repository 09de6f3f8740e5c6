/* A host that is not Python: loads an FMU, runs it, goes back a step, ends.
 *
 *   host BINARY RESOURCES GUID STEPS H SET_REFERENCE VALUE GET_REFERENCE...
 *
 * Prints the outputs after each step with 17 digits, which is every bit of them. The first status
 * that is neither OK nor Warning ends the run: its call is printed and it is the exit code. After
 * fmi2Fatal no further call is made, after any other the instance is terminated and freed.
 */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { CO_SIMULATION = 1, MOST = 64, USAGE = 64, NOT_LOADED = 65, NO_INSTANCE = 66, NOT_BACK = 67 };

typedef void *Component;
typedef unsigned int Reference;

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

static void *library;
static Component instance;

static void print_message(void *environment, const char *name, int status, const char *category,
                          const char *message, ...)
{
    va_list arguments;
    (void)environment, (void)name, (void)category;
    printf("%d: ", status);
    va_start(arguments, message);
    vprintf(message, arguments);
    va_end(arguments);
    printf("\n");
}

/* The function of that name, in a variable of its type. */
static void find(const char *name, void *function)
{
    void *symbol = dlsym(library, name);
    if (!symbol) {
        printf("%s\n", dlerror());
        exit(NOT_LOADED);
    }
    memcpy(function, &symbol, sizeof symbol);
}

static void end(void)
{
    int (*terminate)(Component);
    void (*release)(Component);
    find("fmi2Terminate", &terminate);
    find("fmi2FreeInstance", &release);
    printf("terminated: %d\n", terminate(instance));
    release(instance);
    printf("closed: %d\n", dlclose(library));
}

static void check(const char *call, int status)
{
    if (status <= WARNING)
        return;
    printf("%s: %d\n", call, status);
    if (status != FATAL)
        end();
    exit(status);
}

int main(int count, char **words)
{
    Component (*instantiate)(const char *, int, const char *, const char *, const Callbacks *, int,
                             int);
    int (*setup)(Component, int, double, double, int, double);
    int (*enter)(Component), (*leave)(Component);
    int (*set)(Component, const Reference *, size_t, const double *);
    int (*get)(Component, const Reference *, size_t, double *);
    int (*step)(Component, double, double, int);
    int (*save)(Component, void **), (*restore)(Component, void *), (*forget)(Component, void **);
    Callbacks callbacks = {print_message, calloc, free, NULL, NULL};
    Reference outputs[MOST], input;
    double first[MOST], second[MOST], value, h;
    void *state = NULL;
    size_t n = count > 8 ? (size_t)count - 8 : 0, i;
    int k, steps;

    setvbuf(stdout, NULL, _IOLBF, 0); /* lose nothing, should the FMU end the process */
    if (n < 1 || n > MOST)
        return USAGE;
    steps = atoi(words[4]), h = atof(words[5]);
    input = (Reference)atoi(words[6]), value = atof(words[7]);
    for (i = 0; i < n; i++)
        outputs[i] = (Reference)atoi(words[8 + i]);

    library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        printf("%s\n", dlerror());
        return NOT_LOADED;
    }
    find("fmi2Instantiate", &instantiate), find("fmi2SetupExperiment", &setup);
    find("fmi2EnterInitializationMode", &enter), find("fmi2ExitInitializationMode", &leave);
    find("fmi2SetReal", &set), find("fmi2GetReal", &get), find("fmi2DoStep", &step);
    find("fmi2GetFMUstate", &save), find("fmi2SetFMUstate", &restore);
    find("fmi2FreeFMUstate", &forget);

    instance = instantiate("host", CO_SIMULATION, words[3], words[2], &callbacks, 0, 0);
    if (!instance)
        return NO_INSTANCE;
    check("setupExperiment", setup(instance, 0, 0.0, 0.0, 0, 0.0));
    check("enterInitializationMode", enter(instance));
    check("setReal", set(instance, &input, 1, &value));
    check("exitInitializationMode", leave(instance));
    for (k = 0; k < steps; k++) {
        if (k == steps - 1)
            check("getFMUstate", save(instance, &state));
        check("doStep", step(instance, k * h, h, 0));
        check("getReal", get(instance, outputs, n, first));
        for (i = 0; i < n; i++)
            printf("%.17g%c", first[i], i + 1 < n ? ' ' : '\n');
    }
    check("setFMUstate", restore(instance, state));
    check("doStep", step(instance, (steps - 1) * h, h, 0));
    check("getReal", get(instance, outputs, n, second));
    check("freeFMUstate", forget(instance, &state));
    end();
    if (memcmp(first, second, n * sizeof *first)) {
        printf("the step taken again from the saved state: other outputs\n");
        return NOT_BACK;
    }
    return OK;
}
