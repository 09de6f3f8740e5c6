/* A block as the translator writes them, by hand: a mass that is pushed, with a fault on demand.
   Its Python is hand_written.py. */
#include <math.h>

#include "variable.h"

enum { N_INPUTS = 2, N_OUTPUTS = 3, N_PARAMETERS = 6, N_STATE = 4 };
#define N_VARIABLES 11
#define BLOCK_LONGEST_STEP 1.0

static const Variable variables[N_VARIABLES] = {
    {"force", " N", KIND_REAL, INPUT, 0, 0, 0.0, 0.0, 0.0},
    {"held", "", KIND_BOOLEAN, INPUT, 0, 0, 0.0, 0.0, 0.0},
    {"position", " m", KIND_REAL, OUTPUT, 0, 0, 0.0, 0.0, 0.0},
    {"velocity", " m/s", KIND_REAL, OUTPUT, 0, 0, 0.0, 0.0, 0.0},
    {"moves", "", KIND_BOOLEAN, OUTPUT, 0, 0, 0.0, 0.0, 0.0},
    {"mass", " kg", KIND_REAL, PARAMETER, 1, 1, 1e-3, 1e3, 0.5},
    {"gain", " 1", KIND_REAL, PARAMETER, 0, 1, 0.0, 10.0, 1.0},
    {"start", " m", KIND_REAL, PARAMETER, 1, 0, 0.0, 0.0, 0.0},
    {"seed", "", KIND_INTEGER, PARAMETER, 1, 1, 0.0, 2147483647.0, 1.0},
    {"fault", "", KIND_INTEGER, PARAMETER, 0, 1, 0.0, 3.0, 0.0},
    {"noisy", "", KIND_BOOLEAN, PARAMETER, 1, 0, 0.0, 0.0, 0.0},
};

typedef struct {
    double mass, gain, start, seed, fault;
    int noisy;
} BlockParams;

typedef struct {
    double force;
    int held;
} BlockInputs;

typedef struct {
    double position, velocity, steps;
    int moves;
} BlockState;

typedef struct {
    double position, velocity;
    int moves;
} BlockOutputs;

static void block_params(const double v[N_VARIABLES], BlockParams *p)
{
    p->mass = v[5];
    p->gain = v[6];
    p->start = v[7];
    p->seed = v[8];
    p->fault = v[9];
    p->noisy = v[10] != 0.0;
}

static int block_check(const BlockParams *p, Text *why)
{
    if (p->noisy && p->seed == 0.0) {
        text_put(why, "seed = 0: must be above 0 with noise, 100 %");
        return 0;
    }
    return 1;
}

static void block_inputs(const double v[N_VARIABLES], BlockInputs *u)
{
    u->force = v[0];
    u->held = v[1] != 0.0;
}

static void block_outputs_to(const BlockOutputs *y, double v[N_OUTPUTS])
{
    v[0] = y->position;
    v[1] = y->velocity;
    v[2] = y->moves;
}

static void block_save(const BlockState *x, double numbers[N_STATE])
{
    numbers[0] = x->position;
    numbers[1] = x->velocity;
    numbers[2] = x->steps;
    numbers[3] = x->moves;
}

static void block_load(const double numbers[N_STATE], BlockState *x)
{
    x->position = numbers[0];
    x->velocity = numbers[1];
    x->steps = numbers[2];
    x->moves = numbers[3] != 0.0;
}

static void block_initial_state(const BlockParams *p, const BlockInputs *u, BlockState *x)
{
    x->position = p->fault == 2.0 ? NAN : p->start;
    x->velocity = 0.0;
    x->steps = 0.0;
    x->moves = !u->held;
}

static void block_step(const BlockParams *p, const BlockState *x, const BlockInputs *u, double h,
                       BlockState *after)
{
    double acceleration = u->held ? 0.0 : p->gain * u->force / p->mass;
    after->velocity = p->fault == 1.0 ? HUGE_VAL : x->velocity + h * acceleration;
    after->position = x->position + h * after->velocity;
    after->steps = x->steps + 1.0;
    after->moves = after->velocity != 0.0;
}

static void block_outputs(const BlockParams *p, const BlockState *x, const BlockInputs *u,
                          BlockOutputs *y)
{
    (void)u;
    y->position = x->position;
    y->velocity = p->fault == 3.0 ? NAN : x->velocity;
    y->moves = x->moves;
}
