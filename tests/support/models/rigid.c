/* Takes steps of `inside` s inside, as many as end by a communication point, as FMUs of Simulink do.
 *
 * A step that would end after the stop time is an error, whatever is between two floats. One that is
 * longer than `longest` s is discarded, or ends early, there.
 */
enum { TIME, COUNT, BEGIN, LENGTH, INSIDE, LONGEST, VARIABLES };
#define STATES 0
#define OWN_STEPS
#include "model.h"

static void start(Model *m) {
    *real(m, INSIDE) = 0.01;
    *real(m, LONGEST) = INFINITY;
}

static void equations(Model *m) { (void)m; }

static void advance(Model *m, double end) {
    double rounding = 4.0 * 2.2204460492503131e-16 * (1.0 + fabs(end));

    *real(m, BEGIN) = m->time;
    *real(m, LENGTH) = m->length;
    if (end > m->stop) {
        m->status = 3;
        m->reason = "a step beyond the stop time";
        return;
    }
    end = fmin(end, m->time + *real(m, LONGEST));
    while ((m->v[COUNT]->Int32 + 1) * *real(m, INSIDE) < end + rounding) m->v[COUNT]->Int32++;
    set_time(m, end);
}

#include "fmi.c"
