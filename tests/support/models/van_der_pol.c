/* x0' = x1, x1' = mu (1 - x0^2) x1 - x0 */
enum { TIME, X0, DER_X0, X1, DER_X1, MU, VARIABLES };
#define STATES 2
#define TUNABLE(r) ((r) == MU)
#include "model.h"

static void start(Model *m) {
    *real(m, X0) = 2.0;
    *real(m, MU) = 1.0;
}

static void equations(Model *m) {
    double x0 = *real(m, X0), x1 = *real(m, X1);

    *real(m, DER_X0) = x1;
    *real(m, DER_X1) = *real(m, MU) * (1.0 - x0 * x0) * x1 - x0;
}

#include "fmi.c"
