/* A sampled integrator: x' = held, and with each tick of its clock held = offset - gain x.
 *
 * Its steps never end early, whatever comes. A change of the discrete input starts a countdown of delay s
 * to a tick; the bound input is read with ticks alone. With named > 0 it names the multiples of that, in s,
 * as the times of its events, which are as ticks are. With a GRID, in s, it comes to them in steps of that,
 * and returns for them.
 */
enum { TIME, X, SLOPE, HELD, TICKS, LAST, EVENTS_DONE, OFFSET, TRIGGER, GAIN, PERIOD, FIRST, DELAY,
       FACTOR, NAMED, TICK, COUNTDOWN, BOUND, TAKEN, VARIABLES };
#define STATES 1
#define STATE(i) real(m, X)
#define DERIVATIVE(i) real(m, SLOPE)
#define EVENTS
#define CLOCKS
#define OWN_STEPS
#define OWN double trigger; bool asked;
#define INPUT(r) ((r) == OFFSET || (r) == TRIGGER || (r) == BOUND)
#define DISCRETE(r) ((r) == TRIGGER || (r) == BOUND)
#define TUNABLE(r) ((r) == PERIOD)
#ifndef GRID
#define GRID 0.0
#endif
#include "model.h"

static void start(Model *m) {
    *real(m, X) = 1.0;
    *real(m, GAIN) = *real(m, FACTOR) = 1.0;
    *real(m, PERIOD) = 0.1;
    *real(m, LAST) = -1.0;
}

static void equations(Model *m) { *real(m, SLOPE) = *real(m, HELD); }

/* True if it has come to the time that it named. */
static bool due(Model *m) {
    double time = GRID > 0.0 ? floor(m->time / GRID + 1e-9) * GRID : m->time;

    return *real(m, NAMED) > 0.0 && time > m->next - 1e-12;
}

static void event(Model *m) {
    m->v[EVENTS_DONE]->Int32++;
    if (m->ticking || due(m)) {
        *real(m, HELD) = *real(m, OFFSET) - *real(m, GAIN) * *real(m, X);
        *real(m, LAST) = m->time;
        *real(m, TAKEN) = *real(m, BOUND);
        m->v[TICKS]->Int32++;
    }
    if (*real(m, NAMED) > 0.0 && (due(m) || isinf(m->next)))
        m->next = isinf(m->next) ? *real(m, NAMED) : m->next + *real(m, NAMED);
}

static void advance(Model *m, double end) {
    *real(m, X) += *real(m, HELD) * (end - m->time);
    set_time(m, end);
    m->needed = GRID > 0.0 && due(m);
}

/* Of a clock that is no countdown PERIOD, which grows by FACTOR with each tick. */
static double interval(Model *m, unsigned clock, int *qualifier) {
    if (clock != COUNTDOWN) {
        *qualifier = 2;
        return *real(m, PERIOD) * pow(*real(m, FACTOR), m->v[TICKS]->Int32);
    }
    *qualifier = *real(m, TRIGGER) == m->trigger ? 1 : 2;
    if (*qualifier == 2) m->asked = true;
    m->trigger = *real(m, TRIGGER);
    if (!m->asked) *qualifier = 0;
    return *real(m, DELAY);
}

static double shift(Model *m, unsigned clock) { return clock == TICK ? *real(m, FIRST) : 0.0; }

#include "fmi.c"
