/* A ball falls from h, and leaves the ground with the share e of its speed, until that is below
 * v_min: then it stays there. One state event a bounce.
 */
enum { TIME, H, DER_H, V, DER_V, G, E, V_MIN, VARIABLES };
#define STATES 2
#define INDICATORS 1
#define EVENTS
#define TUNABLE(r) ((r) == E)
#include "model.h"

static void start(Model *m) {
    *real(m, H) = 1.0;
    *real(m, G) = -9.81;
    *real(m, E) = 0.7;
    *real(m, V_MIN) = 0.1;
}

static void equations(Model *m) {
    *real(m, DER_H) = *real(m, V);
    *real(m, DER_V) = *real(m, G);
}

static void indicators(Model *m, double z[]) {
    bool rests = *real(m, H) == 0.0 && *real(m, V) == 0.0;
    z[0] = rests ? 1.0 : *real(m, H);
}

static void event(Model *m) {
    if (*real(m, H) > 0.0 || *real(m, V) >= 0.0) return;
    *real(m, H) = 0.0;
    *real(m, V) *= -*real(m, E);
    if (*real(m, V) < *real(m, V_MIN)) *real(m, V) = *real(m, G) = 0.0;
    m->states_changed = true;
}

#include "fmi.c"
