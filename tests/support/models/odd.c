/* x' = rate, with one oddity, by the parameter `kind`.
 *
 * RELAY: the rate is against x, so that it comes to 0 and chatters there. STEPS: an event after the
 * fifth step of the solver adds 1 to x. ENDLESS: an event at 0.5 s that never settles. ITERATES: one
 * there that adds 1 to x in each of three iterations, the first of which alone says so. STANDS: each
 * event names the next one for now. PAST, NOWHERE: that at 0.5 s names one before it, or
 * at NaN. FAILS, DISCARDS: no slope from x = 0.5 on. NO_NUMBER: it is none from there.
 * WARNS: with a warning from there.
 */
enum { TIME, X, DER_X, RATE, KIND, EVENT_COUNT, U, VARIABLES };
enum { RELAY = 1, STEPS, ENDLESS, ITERATES, STANDS, FAILS, DISCARDS, NO_NUMBER, PAST, NOWHERE, WARNS };
#define STATES 1
#define INDICATORS 1
#define EVENTS
#define COMPLETED
#define INPUT(r) ((r) == U)
#include "model.h"

static int kind(Model *m) { return m->v[KIND]->Int32; }

static void start(Model *m) { *real(m, RATE) = 1.0; }

static void equations(Model *m) {
    bool beyond = *real(m, X) > 0.5;

    m->status = beyond && kind(m) == FAILS ? 3 : beyond && kind(m) == DISCARDS ? 2 : 0;
    if (beyond && kind(m) == WARNS) m->status = 1;
    *real(m, DER_X) = beyond && kind(m) == NO_NUMBER ? NAN : *real(m, RATE);
}

static void indicators(Model *m, double z[]) {
    z[0] = kind(m) == RELAY ? *real(m, X) : 1.0;
}

static void event(Model *m) {
    bool half = m->time == 0.5;

    m->v[EVENT_COUNT]->Int32++;
    if (kind(m) == RELAY) *real(m, RATE) = *real(m, X) > 0.0 ? -1.0 : 1.0;
    if (kind(m) == STANDS) m->next = m->time;
    if (kind(m) == PAST) m->next = half ? 0.25 : 0.5;
    if (kind(m) == NOWHERE) m->next = half ? NAN : 0.5;
    if (kind(m) == STEPS && m->steps == 5) *real(m, X) += 1.0;
    if (kind(m) == ENDLESS || kind(m) == ITERATES) m->next = half ? INFINITY : 0.5;
    m->again = half && (kind(m) == ENDLESS || (kind(m) == ITERATES && m->v[EVENT_COUNT]->Int32 < 4));
    if (half && kind(m) == ITERATES) *real(m, X) += 1.0;
    m->states_changed = m->again;
}

static bool completed(Model *m) { return ++m->steps == 5 && kind(m) == STEPS; }

#include "fmi.c"
