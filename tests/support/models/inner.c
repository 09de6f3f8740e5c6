/* x' = k (u - x), which only locals tell, beside a stamp that a float64 does not hold, 2^53 + 1 + 2 n,
 * where n is the number of steps; empty is not a number from t = 0.25 s on.
 */
enum { TIME, X, DER_X, K, U, TAU, POWER, COUNT, HIGH, LABEL, EMPTY, Y, STAMP, VARIABLES };
#define STATES 1
#define INPUT(r) ((r) == U)
#define TUNABLE(r) ((r) == K)
#include "model.h"

static void start(Model *m) { *real(m, K) = 2.0; }

static void equations(Model *m) {
    double x = *real(m, X), k = *real(m, K);

    *real(m, DER_X) = k * (*real(m, U) - x);
    *real(m, TAU) = 1.0 / k;
    *real(m, Y) = x;
    *real(m, POWER) = x * x;
    *real(m, EMPTY) = m->time < 0.249 ? 0.0 : NAN;
    m->v[COUNT]->Int32 = (int32_t)lround(10.0 * m->time);
    m->v[HIGH]->Boolean = x > 0.5;
    snprintf(m->v[LABEL]->String, TEXT, x > 0.5 ? "high" : "low");
#if FMI == 3
    m->v[STAMP]->UInt64 = (1ull << 53) + 1 + 2 * (uint64_t)lround(10.0 * m->time);
#endif
}

#include "fmi.c"
