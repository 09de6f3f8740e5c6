/* A block as the translator writes them, by hand: a mass that is pushed, with a fault on demand.
   Its Python is hand_written.py. */
#define BLOCK_NAME "HandWritten"
#define N_INPUTS 2
#define N_OUTPUTS 3
#define N_PARAMETERS 6
#define N_VARIABLES (N_INPUTS + N_OUTPUTS + N_PARAMETERS)
#define N_STATE 4
#define BLOCK_LONGEST_STEP 1.0

enum { KIND_REAL, KIND_BOOLEAN, KIND_INTEGER, KIND_STRING };
enum { INPUT, OUTPUT, PARAMETER };

typedef struct {
    const char *name;
    const char *in_unit;
    int kind;
    int causality;
    int fixed;
    int limited;
    double low, high, start;
} Variable;

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
    {"fault", "", KIND_INTEGER, PARAMETER, 0, 1, 0.0, 6.0, 0.0},
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

static void block_check(const BlockParams *p, Fault *fault)
{
    if (p->noisy && p->seed == 0.0) {
        py_fault(fault, FAULT_VALUE, "ValueError", "seed = 0: must be above 0 with noise, 100 %");
    }
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

static void block_load(const double numbers[N_STATE], BlockState *x, Fault *fault)
{
    x->position = numbers[0];
    x->velocity = numbers[1];
    x->moves = numbers[3] != 0.0;
    if (numbers[2] != numbers[2]) {
        py_fault(fault, FAULT_VALUE, "ValueError", "cannot convert float NaN to integer");
    } else if (numbers[2] - numbers[2] != 0.0) {
        py_fault(fault, FAULT_ARITHMETIC, "OverflowError",
                 "cannot convert float infinity to integer");
    } else {
        x->steps = (numbers[2] < 0.0 ? ceil(numbers[2]) : floor(numbers[2])) + 0.0;
    }
}

static void block_initial_state(const BlockParams *p, const BlockInputs *u, BlockState *x,
                                Fault *fault)
{
    x->position = p->start;
    x->velocity = 0.0;
    x->steps = 0.0;
    x->moves = !u->held;
    if (p->fault == 5.0) {
        py_fault(fault, FAULT_OTHER, "LookupError", "no lamp");
    }
}

static void block_step(const BlockParams *p, const BlockState *x, const BlockInputs *u, double h,
                       BlockState *after, Fault *fault)
{
    double acceleration = u->held ? 0.0 : p->gain * u->force / p->mass;
    if (p->fault == 1.0) {
        py_fault(fault, FAULT_OWN, "ArithmeticError", "too fast: must be slower");
    } else if (p->fault == 2.0) {
        py_fault(fault, FAULT_ARITHMETIC, "ZeroDivisionError", "float division by zero");
    } else if (p->fault == 3.0) {
        py_fault(fault, FAULT_VALUE, "ValueError", "math domain error");
    }
    after->velocity = x->velocity + h * acceleration;
    after->position = x->position + h * after->velocity;
    after->steps = x->steps + 1.0;
    after->moves = after->velocity != 0.0;
}

static void block_outputs(const BlockParams *p, const BlockState *x, const BlockInputs *u,
                          BlockOutputs *y, Fault *fault)
{
    (void)u;
    y->position = x->position;
    y->velocity = x->velocity;
    y->moves = x->moves;
    if (p->fault == 4.0) {
        py_fault(fault, FAULT_OTHER, "KeyError", "'50 %n'");
    } else if (p->fault == 6.0) {
        y->velocity = HUGE_VAL - HUGE_VAL;
    }
}
