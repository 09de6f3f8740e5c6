/* Outputs are inputs, for each type of FMI: y = u. Of Real and Float64 there is a discrete pair, too. */
#ifdef FMI2
#define PAIRS(X) \
    X(Float64, REAL) X(Float64, DISCRETE) X(Int32, INTEGER) X(Boolean, BOOLEAN) \
    X(String, STRING) X(Int32, ENUMERATION)
#else
#define PAIRS(X) \
    X(Float64, FLOAT64) X(Float64, DISCRETE) X(Float32, FLOAT32) X(Int8, INT8) X(UInt8, UINT8) \
    X(Int16, INT16) X(UInt16, UINT16) X(Int32, INT32) X(UInt32, UINT32) X(Int64, INT64) \
    X(UInt64, UINT64) X(Boolean, BOOLEAN) X(String, STRING) X(String, BINARY) \
    X(Int64, ENUMERATION)
#endif
#define NAMED(type, name) U_##name, Y_##name,
enum { TIME, PAIRS(NAMED) VARIABLES };
#define STATES 0
#define INDICATORS 0
#define INPUT(r) ((r) % 2 == 1) /* the first of each pair */
#define TUNABLE(r) false
static const int state[] = {0}, derivative[] = {0};
#include "model.h"

static void start(Model *m) {
    m->v[U_ENUMERATION].Int64 = 1;
}

static void equations(Model *m) {
#define PASS(type, name) m->v[Y_##name] = m->v[U_##name];
    PAIRS(PASS)
}

static void indicators(const Model *m, double z[]) { (void)m; (void)z; }
static void event(Model *m) { (void)m; }
static bool completed(Model *m) { (void)m; return false; }

#include FMI
