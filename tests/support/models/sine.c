/* Counts the times at which sin(2 pi f t) leaves z > 0 or enters it: state events without a state. */
enum { TIME, COUNT, F, VARIABLES };
#define STATES 0
#define INDICATORS 1
#define INPUT(r) false
#define TUNABLE(r) false
static const int state[] = {0}, derivative[] = {0};
#include "model.h"

static void start(Model *m) {
    *real(m, F) = 1.0;
    m->v[COUNT].Int32 = -1; /* the event of the initialisation makes it 0 */
}

static void equations(Model *m) { (void)m; }
static void indicators(const Model *m, double z[]) { z[0] = sin(6.283185307179586 * m->v[F].Float64 * m->time); }
static void event(Model *m) { m->v[COUNT].Int32++; }
static bool completed(Model *m) { (void)m; return false; }

#include FMI
