/* x' = -k x + u, y = x + d u: with u = 0 an exponential */
enum { TIME, X, DER_X, K, U, D, Y, VARIABLES };
#define STATES 1
#define INPUT(r) ((r) == U)
#define TUNABLE(r) ((r) == K)
#include "model.h"

static void start(Model *m) { *real(m, X) = *real(m, K) = 1.0; }

static void equations(Model *m) {
    *real(m, DER_X) = -*real(m, K) * *real(m, X) + *real(m, U);
    *real(m, Y) = *real(m, X) + *real(m, D) * *real(m, U);
}

#include "fmi.c"
