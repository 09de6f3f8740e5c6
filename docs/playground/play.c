/* The loop of a page: components that are native FMUs, connected, stepped, recorded.

   It does what the master does with a system of fixed steps whose connections take values as they
   are: values at t = 0 that agree with each other, then macro steps in either scheme. It knows no
   FMU by itself: kinds.h names those that are linked with it. The page calls, in this order,

       play_begin()                             forgets all, also the memory
       play_component(kind)                     its name is in play_text(); returns its number
       play_set(component, type, vr, value)     a start value
       play_connect(from, vr, to, vr)           Real output to Real input
       play_record(component, type, vr)         an output; returns its column
       play_run(step_ns, steps, jacobi)         returns the rows recorded, play_text() says why fewer

   and reads rows from play_columns(): column c begins at c*(steps + 1). */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "fmi2Functions.h"

enum { MOST_COMPONENTS = 8, MOST_PORTS = 48, TEXT_SIZE = 2048 };
enum { REAL, BOOLEAN, INTEGER };

typedef struct {
    const char *guid;
    fmi2Component (*instantiate)(fmi2String, fmi2Type, fmi2String, fmi2String,
                                 const fmi2CallbackFunctions *, fmi2Boolean, fmi2Boolean);
    fmi2Status (*setup)(fmi2Component, fmi2Boolean, fmi2Real, fmi2Real, fmi2Boolean, fmi2Real);
    fmi2Status (*enter)(fmi2Component);
    fmi2Status (*leave)(fmi2Component);
    fmi2Status (*set_real)(fmi2Component, const fmi2ValueReference *, size_t, const fmi2Real *);
    fmi2Status (*set_boolean)(fmi2Component, const fmi2ValueReference *, size_t,
                              const fmi2Boolean *);
    fmi2Status (*set_integer)(fmi2Component, const fmi2ValueReference *, size_t,
                              const fmi2Integer *);
    fmi2Status (*get_real)(fmi2Component, const fmi2ValueReference *, size_t, fmi2Real *);
    fmi2Status (*get_boolean)(fmi2Component, const fmi2ValueReference *, size_t, fmi2Boolean *);
    fmi2Status (*step)(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean);
} Kind;

#define DECLARED(Model)                                                                            \
    fmi2InstantiateTYPE Model##_fmi2Instantiate;                                                   \
    fmi2SetupExperimentTYPE Model##_fmi2SetupExperiment;                                           \
    fmi2EnterInitializationModeTYPE Model##_fmi2EnterInitializationMode;                           \
    fmi2ExitInitializationModeTYPE Model##_fmi2ExitInitializationMode;                             \
    fmi2SetRealTYPE Model##_fmi2SetReal;                                                           \
    fmi2SetBooleanTYPE Model##_fmi2SetBoolean;                                                     \
    fmi2SetIntegerTYPE Model##_fmi2SetInteger;                                                     \
    fmi2GetRealTYPE Model##_fmi2GetReal;                                                           \
    fmi2GetBooleanTYPE Model##_fmi2GetBoolean;                                                     \
    fmi2DoStepTYPE Model##_fmi2DoStep;
#define LISTED(Model)                                                                              \
    {GUID, Model##_fmi2Instantiate, Model##_fmi2SetupExperiment,                                   \
     Model##_fmi2EnterInitializationMode, Model##_fmi2ExitInitializationMode,                      \
     Model##_fmi2SetReal, Model##_fmi2SetBoolean, Model##_fmi2SetInteger, Model##_fmi2GetReal,     \
     Model##_fmi2GetBoolean, Model##_fmi2DoStep},

#include "kinds.h" /* GUID, KINDS(EACH), SOURCES */

KINDS(DECLARED)
static const Kind kinds[] = {KINDS(LISTED)};
static const char sources[] = "sources sha256 " SOURCES;

/* Outputs or connected inputs of a component, and their values now */
typedef struct {
    int count;
    fmi2ValueReference vr[MOST_PORTS];
    fmi2Real values[MOST_PORTS];
    int other[MOST_PORTS]; /* of an input: its source; of an output: its column */
    int place[MOST_PORTS]; /* of an input: that of the output among those of its source */
} Ports;

typedef struct {
    const Kind *kind;
    fmi2Component instance;
    Ports inputs, reals, booleans;
} Component;

static Component components[MOST_COMPONENTS];
static int n_components, n_columns;
static double *columns;
static char text[TEXT_SIZE];

/* Memory: from the end of the program on, given back all at once */

extern unsigned char __heap_base;
static uintptr_t used;

static void *taken(size_t count, size_t size)
{
    size_t wanted = (count * size + 15) & ~(size_t)15;
    uintptr_t begin = used, end = begin + wanted, there = __builtin_wasm_memory_size(0) << 16;
    if (end > there && __builtin_wasm_memory_grow(0, (end - there + 0xffff) >> 16) == (size_t)-1) {
        return NULL;
    }
    used = end;
    return memset((void *)begin, 0, wanted);
}

static void given_back(void *memory)
{
    (void)memory;
}

/* The last line of the FMUs' log */
static void logged(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String message, ...)
{
    size_t length = 0;
    (void)environment, (void)name, (void)status, (void)category;
    while (*message && length + 1 < sizeof text) {
        text[length++] = *message;
        message += message[0] == '%' && message[1] == '%' ? 2 : 1; /* it is a printf */
    }
    text[length] = '\0';
}

static const fmi2CallbackFunctions callbacks = {logged, taken, given_back, NULL, NULL};

/* What the page calls */

char *play_text(void)
{
    return text;
}

const char *play_sources(void)
{
    return sources;
}

double *play_columns(void)
{
    return columns;
}

void play_begin(void)
{
    used = ((uintptr_t)&__heap_base + 15) & ~(uintptr_t)15;
    memset(components, 0, sizeof components);
    n_components = n_columns = 0;
    text[0] = '\0';
}

int play_component(int kind)
{
    Component *c = &components[n_components];
    char *name = taken(strlen(text) + 1, 1);
    strcpy(name, text);
    text[0] = '\0';
    c->kind = &kinds[kind];
    c->instance =
        c->kind->instantiate(name, fmi2CoSimulation, c->kind->guid, "", &callbacks, 0, 0);
    return c->instance ? n_components++ : -1;
}

int play_set(int component, int type, fmi2ValueReference vr, double value)
{
    const Component *c = &components[component];
    fmi2Integer whole;
    if (type == REAL) {
        return c->kind->set_real(c->instance, &vr, 1, &value) <= fmi2Warning;
    }
    whole = (fmi2Integer)value;
    return (type == BOOLEAN ? c->kind->set_boolean : c->kind->set_integer)(c->instance, &vr, 1,
                                                                           &whole) <= fmi2Warning;
}

static int place_of(Ports *ports, fmi2ValueReference vr)
{
    int i;
    for (i = 0; i < ports->count && ports->vr[i] != vr; i++) {
    }
    if (i == ports->count) {
        ports->vr[ports->count++] = vr;
    }
    return i;
}

int play_record(int component, int type, fmi2ValueReference vr)
{
    Component *c = &components[component];
    Ports *ports = type == REAL ? &c->reals : &c->booleans;
    ports->other[place_of(ports, vr)] = n_columns;
    return n_columns++;
}

void play_connect(int from, fmi2ValueReference source, int to, fmi2ValueReference target)
{
    Ports *inputs = &components[to].inputs;
    int i = place_of(inputs, target);
    inputs->other[i] = from;
    inputs->place[i] = place_of(&components[from].reals, source);
}

/* The master */

static void moved(Component *c)
{
    Ports *in = &c->inputs;
    int i;
    for (i = 0; i < in->count; i++) {
        in->values[i] = components[in->other[i]].reals.values[in->place[i]];
    }
}

static int passed(Component *c)
{
    const Ports *in = &c->inputs;
    return c->kind->set_real(c->instance, in->vr, (size_t)in->count, in->values) <= fmi2Warning;
}

static int fetched(Component *c)
{
    Ports *reals = &c->reals, *booleans = &c->booleans;
    fmi2Boolean found[MOST_PORTS];
    int i;
    if (c->kind->get_real(c->instance, reals->vr, (size_t)reals->count, reals->values)
            > fmi2Warning
        || c->kind->get_boolean(c->instance, booleans->vr, (size_t)booleans->count, found)
               > fmi2Warning) {
        return 0;
    }
    for (i = 0; i < booleans->count; i++) {
        booleans->values[i] = found[i];
    }
    return 1;
}

/* An input at t = 0 depends on an output, which depends on inputs: passed on until nothing can
   change any more, which is after as many rounds as there are components. */
static int initialised(double stop)
{
    int round, i;
    for (i = 0; i < n_components; i++) {
        Component *c = &components[i];
        if (c->kind->setup(c->instance, 0, 0.0, 0.0, 1, stop) > fmi2Warning
            || c->kind->enter(c->instance) > fmi2Warning) {
            return 0;
        }
    }
    for (round = 0; round <= n_components; round++) {
        for (i = 0; i < n_components; i++) {
            Component *c = &components[i];
            if (round || i) {
                moved(c);
                if (!passed(c)) {
                    return 0;
                }
            }
            if (!fetched(c)) {
                return 0;
            }
        }
    }
    for (i = 0; i < n_components; i++) {
        if (components[i].kind->leave(components[i].instance) > fmi2Warning) {
            return 0;
        }
    }
    return 1;
}

static int stepped(Component *c, double time, double step)
{
    return c->kind->step(c->instance, time, step, 1) <= fmi2Warning && fetched(c);
}

static int macro_step(double time, double step, int jacobi)
{
    int i;
    if (!jacobi) {
        for (i = 0; i < n_components; i++) {
            moved(&components[i]);
            if (!passed(&components[i]) || !stepped(&components[i], time, step)) {
                return 0;
            }
        }
        return 1;
    }
    for (i = 0; i < n_components; i++) {
        moved(&components[i]);
    }
    for (i = 0; i < n_components; i++) {
        if (!passed(&components[i]) || !stepped(&components[i], time, step)) {
            return 0;
        }
    }
    return 1;
}

static void recorded(int row, int rows)
{
    int i, j;
    for (i = 0; i < n_components; i++) {
        const Ports *ports[] = {&components[i].reals, &components[i].booleans};
        for (j = 0; j < 2; j++) {
            int k;
            for (k = 0; k < ports[j]->count; k++) {
                columns[(size_t)ports[j]->other[k] * (size_t)rows + (size_t)row] =
                    ports[j]->values[k];
            }
        }
    }
}

int play_run(double step_ns, int steps, int jacobi)
{
    int k;
    columns = taken((size_t)n_columns * (size_t)(steps + 1), sizeof *columns);
    if (!columns) {
        strcpy(text, "no memory for so many steps; must be fewer");
        return 0;
    }
    if (!initialised((double)steps * step_ns / 1e9)) {
        return 0;
    }
    recorded(0, steps + 1);
    for (k = 0; k < steps; k++) {
        if (!macro_step((double)k * step_ns / 1e9, step_ns / 1e9, jacobi)) {
            return k + 1;
        }
        recorded(k + 1, steps + 1);
    }
    return steps + 1;
}
