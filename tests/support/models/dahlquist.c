/* x' = -k x + u, y = x + d u: with u = 0 an exponential */
enum { TIME, X, DER_X, K, U, D, Y, VARIABLES };
#define STATES 1
#define INDICATORS 0
#define INPUT(r) ((r) == U)
#define TUNABLE(r) ((r) == K)
static const int state[] = {X}, derivative[] = {DER_X};
#include "model.h"

static void start(Model *m) {
    *real(m, X) = 1.0;
    *real(m, K) = 1.0;
}

static void equations(Model *m) {
    *real(m, DER_X) = -*real(m, K) * *real(m, X) + *real(m, U);
    *real(m, Y) = *real(m, X) + *real(m, D) * *real(m, U);
}

static void indicators(const Model *m, double z[]) { (void)m; (void)z; }
static void event(Model *m) { (void)m; }
static bool completed(Model *m) { (void)m; return false; }

#include FMI
