/* A counter that rises by 1 every `width` seconds, and asks for the end of the simulation at `last`:
 * time events, without a state.
 */
enum { TIME, COUNTER, WIDTH, LAST, VARIABLES };
#define STATES 0
#define EVENTS
#include "model.h"

static void start(Model *m) {
    m->v[COUNTER]->Int32 = 1;
    *real(m, WIDTH) = 1.0;
    m->v[LAST]->Int32 = 10;
}

static void equations(Model *m) { (void)m; }

static void event(Model *m) {
    if (isinf(m->next)) m->next = m->time + *real(m, WIDTH); /* the first one, of initialisation */
    if (m->time >= m->next) {
        m->v[COUNTER]->Int32++;
        m->next += *real(m, WIDTH);
    }
    m->ended = m->v[COUNTER]->Int32 >= m->v[LAST]->Int32;
}

#include "fmi.c"
