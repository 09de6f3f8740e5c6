/* What the file of a model defines, and what fmi.c makes an FMU of.
 *
 * A model file has an enum of its variables, which are also the value references, TIME among them and
 * VARIABLES last; its number of STATES, which come first, each with its derivative behind it; which
 * variables are INPUTs or TUNABLE; and the functions start() and equations(). It includes this header
 * between the numbers and the functions, and fmi.c at its end. A model may have INDICATORS, EVENTS,
 * CLOCKS, COMPLETED, REFUSAL or OWN_STEPS as well, see below: it defines these, then the function.
 *
 * Model exchange integrates nothing here. Co-simulation takes Runge-Kutta steps of SUBSTEP at most,
 * and halves them at an event.
 */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef TEXT
#define TEXT 256            /* bytes of a String */
#endif

typedef union { /* of any type of FMI; in FMI 2.0 Float64, Int32, Boolean, String */
    double Float64;
    float Float32;
    int8_t Int8;
    uint8_t UInt8;
    int16_t Int16;
    uint16_t UInt16;
    int32_t Int32;
    uint32_t UInt32;
    int64_t Int64;
    uint64_t UInt64;
    bool Boolean;
    char String[TEXT];
} Value;

typedef enum { INSTANTIATED, CONFIGURING, INITIALIZATION, EVENT, CONTINUOUS, STEP, TERMINATED } Mode;

#ifndef LARGEST
#define LARGEST 1           /* elements of an array */
#endif
#ifndef SIZE
#define SIZE(r) 1           /* elements of a variable */
#endif
#ifndef INPUT
#define INPUT(r) false
#endif
#ifndef DISCRETE
#define DISCRETE(r) false   /* inputs that change at events alone */
#endif
#ifndef TUNABLE
#define TUNABLE(r) false
#endif
#ifndef STRUCTURAL
#define STRUCTURAL(r) false /* parameters that are set in configuration mode alone */
#endif
#ifndef STATE
#define STATE(i) real(m, 1 + 2 * (i))
#define DERIVATIVE(i) real(m, 2 + 2 * (i))
#endif
#ifndef OWN
#define OWN                 /* further members of a model */
#endif
#ifndef SUBSTEP
#define SUBSTEP 1e-3        /* s */
#endif
#define ROOM 32             /* for states, or indicators */

typedef struct {
    Value v[VARIABLES][LARGEST];
    double time, next;                /* s; of the next time event, INFINITY where there is none */
    double stop, length;              /* s; the stop time, INFINITY without one, and of this step */
    bool again;                       /* the event needs another iteration */
    bool states_changed, nominals_changed, ended;
    bool early;                       /* a step may end early */
    bool events, needed;              /* its events are handled with the host; one is to be now */
    unsigned ticking;                 /* the clock that ticks in this event, or 0 */
    double nominal[ROOM];             /* of the states */
    int status;                       /* of the equations, or of a step, as FMI has it, */
    const char *reason;               /* and why, NULL where it is not logged */
    double tolerance;                 /* that it was told, 0 where none */
    bool logging;                     /* asked for at the instantiation */
    int steps;                        /* of the solver */
    Mode mode;
    bool exchange;                    /* model exchange, else co-simulation */
    size_t binary;                    /* bytes of a Binary, which is in a String */
    void *host;
    void *log;
    char name[128];
    OWN
} Model;

static double *real(Model *m, int variable) { return &m->v[variable]->Float64; }

static void start(Model *m);     /* start values, also for new sizes */
static void equations(Model *m); /* what follows from time, states, inputs */

#ifdef INDICATORS
static void indicators(Model *m, double z[]); /* an event is where one leaves z > 0, or enters */
#else
#define INDICATORS 0
static void indicators(Model *m, double z[]) { (void)m; (void)z; }
#endif
#ifdef EVENTS
static void event(Model *m); /* one iteration of an event */
#else
static void event(Model *m) { (void)m; }
#endif
#ifdef CLOCKS
/* s to the next tick of a clock, or the first one; what FMI calls its qualifier, 2 for a new one. */
static double interval(Model *m, unsigned clock, int *qualifier);
static double shift(Model *m, unsigned clock);
#endif
#ifdef COMPLETED
static bool completed(Model *m); /* a step of the solver; true for an event there */
#else
static bool completed(Model *m) { (void)m; return false; }
#endif
#ifdef REFUSAL
static const char *refusal(Model *m); /* why sizes, or start values, are refused */
#else
static const char *refusal(Model *m) { (void)m; return NULL; }
#endif

static void set_time(Model *m, double time) { m->time = *real(m, TIME) = time; }

static void put_states(Model *m, const double x[]) {
    for (int i = 0; i < STATES; i++) *STATE(i) = x[i];
}

static void get_states(Model *m, double x[]) {
    for (int i = 0; i < STATES; i++) x[i] = *STATE(i);
}

static void slopes(Model *m, double dx[]) {
    equations(m);
    for (int i = 0; i < STATES; i++) dx[i] = *DERIVATIVE(i);
}

/* Iterate an event at the current time until nothing changes. */
static void settle(Model *m) {
    do {
        m->again = false;
        event(m);
    } while (m->again);
    equations(m);
}

#ifdef OWN_STEPS
static void advance(Model *m, double end);
#else
/* From the states x at a time over a step of h seconds, by the classical Runge-Kutta method. */
static void integrate(Model *m, double time, const double x[], double h) {
    static const double at[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0, 2.0, 2.0, 1.0};
    double dx[ROOM] = {0.0}, mean[ROOM] = {0.0}, y[ROOM];

    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < STATES; i++) y[i] = x[i] + at[k] * h * dx[i];
        put_states(m, y);
        set_time(m, time + at[k] * h);
        slopes(m, dx);
        for (int i = 0; i < STATES; i++) mean[i] += weight[k] * dx[i] / 6.0;
    }
    for (int i = 0; i < STATES; i++) y[i] = x[i] + h * mean[i];
    put_states(m, y);
    set_time(m, time + h);
    equations(m);
}

/* True if an indicator is on another side of 0 than in z. */
static bool crossed(Model *m, const double z[]) {
    double now[ROOM];

    indicators(m, now);
    for (int i = 0; i < INDICATORS; i++)
        if ((now[i] > 0.0) != (z[i] > 0.0)) return true;
    return false;
}

/* Co-simulation: go on to a time, or to where the model asks for the end, or has an event that is
 * handled with the host.
 */
static void advance(Model *m, double end) {
    double x[ROOM], z[ROOM];

    while (m->time < end && !m->ended && !m->needed) {
        double begin = m->time, stop = fmin(fmin(end, m->next), begin + SUBSTEP);
        double low = 0.0, high = stop - begin;
        bool at_event;

        get_states(m, x);
        indicators(m, z);
        integrate(m, begin, x, high);
        at_event = crossed(m, z);
        for (int i = 0; i < 60 && at_event; i++) {
            double middle = 0.5 * (low + high);
            integrate(m, begin, x, middle);
            if (crossed(m, z)) high = middle;
            else low = middle;
        }
        if (at_event) integrate(m, begin, x, high);
        else set_time(m, stop);
        if (!at_event && m->time < m->next) continue;
        if (m->events && (m->early || m->time >= end)) m->needed = true;
        else settle(m);
    }
}
#endif

/* True if a variable may be set now. */
static bool may_set(Model *m, unsigned variable, bool continuous) {
    if (variable == TIME || variable >= VARIABLES) return false;
    if (STRUCTURAL(variable) || m->mode == CONFIGURING)
        return STRUCTURAL(variable) && m->mode == CONFIGURING;
    if (m->mode == INSTANTIATED || m->mode == INITIALIZATION) return true;
    if (m->mode == CONTINUOUS || (m->mode == STEP && m->events))
        return INPUT(variable) && !DISCRETE(variable) && continuous;
    return (m->mode == EVENT || m->mode == STEP) && (INPUT(variable) || TUNABLE(variable));
}
