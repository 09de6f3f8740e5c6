/* Counts the times at which sin(2 pi f t) leaves z > 0 or enters it: state events without a state. */
enum { TIME, CROSSINGS, FREQUENCY, VARIABLES };
#define STATES 0
#define INDICATORS 1
#define EVENTS
#include "model.h"

static void start(Model *m) {
    *real(m, FREQUENCY) = 1.0;
    m->v[CROSSINGS]->Int32 = -1; /* the event of the initialisation makes it 0 */
}

static void equations(Model *m) { (void)m; }

static void indicators(Model *m, double z[]) {
    z[0] = sin(6.283185307179586 * *real(m, FREQUENCY) * m->time);
}

static void event(Model *m) { m->v[CROSSINGS]->Int32++; }

#include "fmi.c"
