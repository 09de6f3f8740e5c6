/* x0' = x1, x1' = mu (1 - x0^2) x1 - x0 */
enum { TIME, X0, DER_X0, X1, DER_X1, MU, VARIABLES };
#define STATES 2
#define INDICATORS 0
#define INPUT(r) false
#define TUNABLE(r) ((r) == MU)
static const int state[] = {X0, X1}, derivative[] = {DER_X0, DER_X1};
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

static void indicators(const Model *m, double z[]) { (void)m; (void)z; }
static void event(Model *m) { (void)m; }
static bool completed(Model *m) { (void)m; return false; }

#include FMI
