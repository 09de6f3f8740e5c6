/* Hands every scalar type through, y_T = u_T, and misbehaves on demand; x' = gain u of the first type.
 *
 * The parameters from crash_at to interrupted are times in s at which the step that contains them goes
 * wrong. interrupt_at has the process of the number in interrupted get SIGINT from within that step.
 */
#include <signal.h>
#include <unistd.h>

enum { CRASH = 1, EXIT, HANG, ERROR, DISCARD, EARLY, TERMINATE, GAIN, INTERRUPT, INTERRUPTED, LAST };
enum { X = 20, NOW, STEPS_DONE = 30, WIDTH = 40, WIDTH_OUT, IN = 100, TIME = 153, OUT = 200,
       TYPES = 13, ENUMERATION = 11, VARIABLES = OUT + TYPES };
#define STATES 0
#define REFUSAL
#define OWN_STEPS
#define INPUT(r) ((r) >= IN && (r) < OUT)
#define TUNABLE(r) ((r) == GAIN)
#define STRUCTURAL(r) ((r) == WIDTH)
#include "model.h"

static void start(Model *m) {
    for (int i = 1; i < LAST; i++) *real(m, i) = i == GAIN ? 1.0 : 1e9;
    m->v[IN + ENUMERATION]->Int64 = 1;
    if (m->v[WIDTH]->UInt64) return; /* it was configured */
    m->v[WIDTH]->UInt64 = 3;
    printf("native FMU %d.0 instantiated\n", FMI); /* pollutes standard output, as vendors do */
    fflush(stdout);
}

static const char *refusal(Model *m) { return *real(m, GAIN) < 0.0 ? "gain must be >= 0" : NULL; }

static void equations(Model *m) {
    for (int i = 0; i < TYPES; i++) *m->v[OUT + i] = *m->v[IN + i];
    *m->v[WIDTH_OUT] = *m->v[WIDTH];
    *real(m, NOW) = m->time;
}

static void advance(Model *m, double end) {
    double begin = m->time;
#define WITHIN(what) (*real(m, what) > begin + 1e-12 && *real(m, what) < end - 1e-12)

    if (WITHIN(CRASH)) *(volatile int *)0 = 1;
    if (WITHIN(EXIT)) _exit(7);
    if (WITHIN(INTERRUPT)) kill((pid_t)*real(m, INTERRUPTED), SIGINT);
    if (WITHIN(HANG)) dprintf(STDERR_FILENO, "native FMU hangs\n");
    while (WITHIN(HANG)) pause();
    if (WITHIN(ERROR) || WITHIN(DISCARD)) {
        m->status = WITHIN(ERROR) ? 3 : 2;
        m->reason = WITHIN(ERROR) ? "the lamp\nis broken" : "the step is too long";
        return;
    }
    m->ended = WITHIN(TERMINATE);
    if (m->ended || (m->early && WITHIN(EARLY))) end = *real(m, m->ended ? TERMINATE : EARLY);
    *real(m, X) += *real(m, GAIN) * *real(m, IN) * (end - begin);
    set_time(m, end);
    m->v[STEPS_DONE]->UInt64++;
}

#include "fmi.c"
