/* Arrays: dx/dt = A x + B u, y = C x + D u, and for each type T of FMI 3.0 y_T = u_T, 2 x k. The numbers
 * m of inputs, n of states and r of outputs, and k, are structural parameters.
 */
#define MOST 24 /* inputs, states or outputs */
#define TYPES 12
enum { TIME, M, N, R, K, A, B, C, D, X0, U, Y, X, DER_X, IN = 100, OUT = 200, VARIABLES = 212 };
#define LARGEST (MOST * MOST)
#define TEXT 8
#define SUBSTEP 2.5e-4
#define SIZE(r) size(m, r)
#define STATES ((int)m->v[N]->UInt64)
#define STATE(i) (&m->v[X][i].Float64)
#define DERIVATIVE(i) (&m->v[DER_X][i].Float64)
#define INPUT(r) ((r) == U || ((r) >= IN && (r) < OUT))
#define TUNABLE(r) ((r) >= A && (r) <= D)
#define STRUCTURAL(r) ((r) >= M && (r) <= K)
#define REFUSAL
#include "model.h"

static int number(Model *m, int variable) { return (int)m->v[variable]->UInt64; }

/* The rows and columns of a variable. */
static void shape(Model *m, int variable, int *rows, int *columns) {
    int inputs = number(m, M), states = number(m, N), outputs = number(m, R);

    *rows = variable >= IN ? 2 : variable == Y || variable == C || variable == D ? outputs
          : variable == U ? inputs : variable >= A ? states : 1;
    *columns = variable >= IN ? number(m, K) : variable == A || variable == C ? states
             : variable == B || variable == D ? inputs : 1;
}

static int size(Model *m, int variable) {
    int rows, columns;

    shape(m, variable, &rows, &columns);
    return rows * columns;
}

static const char *refusal(Model *m) {
    for (int i = M; i <= K; i++)
        if (number(m, i) > MOST) return "at most 24";
    return NULL;
}

static void start(Model *m) {
    for (int i = M; i <= K; i++)
        if (!number(m, i)) m->v[i]->UInt64 = 3;
    for (int matrix = A; matrix <= D; matrix++) {
        int rows, columns;

        shape(m, matrix, &rows, &columns);
        for (int i = 0; i < rows * columns; i++) m->v[matrix][i].Float64 = i / columns == i % columns;
    }
    for (int i = 0; i < MOST; i++) m->v[U][i].Float64 = i + 1;
    for (int i = 0; i < 2 * MOST; i++) m->v[IN + TYPES - 1][i].Int64 = 1; /* the Enumeration */
}

/* to = A x + B u, of any two matrices */
static void sum(Model *m, int to, int a, int b) {
    int rows = size(m, to), states = number(m, N), inputs = number(m, M);

    for (int i = 0; i < rows; i++) {
        double *sum = &m->v[to][i].Float64;

        *sum = 0.0;
        for (int j = 0; j < states; j++)
            *sum += m->v[a][i * states + j].Float64 * m->v[X][j].Float64;
        for (int j = 0; j < inputs; j++)
            *sum += m->v[b][i * inputs + j].Float64 * m->v[U][j].Float64;
    }
}

static void equations(Model *m) {
    if (m->mode < EVENT) memcpy(m->v[X], m->v[X0], sizeof m->v[X]);
    sum(m, DER_X, A, B);
    sum(m, Y, C, D);
    for (int i = 0; i < TYPES; i++) memcpy(m->v[OUT + i], m->v[IN + i], 2 * MOST * sizeof(Value));
}

#include "fmi.c"
