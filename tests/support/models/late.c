/* y = base + gain u, once initialisation mode has been left: before that, y = 0. */
enum { TIME, U, Y, BASE, GAIN, VARIABLES };
#define STATES 0
#define EVENTS
#define OWN bool ready;
#define INPUT(r) ((r) == U)
#include "model.h"

static void start(Model *m) { *real(m, GAIN) = 1.0; }

static void equations(Model *m) {
    *real(m, Y) = m->ready ? *real(m, BASE) + *real(m, GAIN) * *real(m, U) : 0.0;
}

static void event(Model *m) { m->ready = true; }

#include "fmi.c"
