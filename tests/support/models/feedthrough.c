/* Outputs are inputs, for each type of FMI: y = u. Of Real and Float64 there is a discrete pair, too. */
#if FMI == 2
#define PAIRS(X) \
    X(REAL) X(DISCRETE) X(INTEGER) X(BOOLEAN) \
    X(STRING) X(ENUMERATION)
#else
#define PAIRS(X) \
    X(FLOAT64) X(DISCRETE) X(FLOAT32) X(INT8) X(UINT8) \
    X(INT16) X(UINT16) X(INT32) X(UINT32) X(INT64) \
    X(UINT64) X(BOOLEAN) X(STRING) X(BINARY) \
    X(ENUMERATION)
#endif
#define NAMED(name) U_##name, Y_##name,
enum { TIME, PAIRS(NAMED) VARIABLES };
#define STATES 0
#define INPUT(r) ((r) % 2 == 1) /* the first of each pair */
#include "model.h"

static void start(Model *m) { m->v[U_ENUMERATION]->Int64 = 1; }

static void equations(Model *m) {
#define PASS(name) *m->v[Y_##name] = *m->v[U_##name];
    PAIRS(PASS)
}

#include "fmi.c"
