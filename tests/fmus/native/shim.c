/* The block behind functions of plain numbers, for ctypes. */
#include "block.h"

static int reported(const Fault *fault, char *type, char *text)
{
    if (fault->kind != FAULT_NONE) {
        strcpy(type, fault->type);
        strcpy(text, fault->text);
    }
    return fault->kind;
}

int shim_sizes(int *sizes)
{
    sizes[0] = N_VARIABLES;
    sizes[1] = N_OUTPUTS;
    sizes[2] = N_STATE;
    return (int)sizeof variables / (int)sizeof variables[0];
}

int shim_check(const double *v, char *type, char *text)
{
    BlockParams p;
    Fault fault;
    fault.kind = FAULT_NONE;
    block_params(v, &p);
    block_check(&p, &fault);
    return reported(&fault, type, text);
}

int shim_initial_state(const double *v, double *state, char *type, char *text)
{
    BlockParams p;
    BlockInputs u;
    BlockState x;
    Fault fault;
    fault.kind = FAULT_NONE;
    block_params(v, &p);
    block_inputs(v, &u);
    block_initial_state(&p, &u, &x, &fault);
    block_save(&x, state);
    return reported(&fault, type, text);
}

int shim_step(const double *v, const double *state, double h, double *after, char *type, char *text)
{
    BlockParams p;
    BlockInputs u;
    BlockState x, y;
    Fault fault;
    fault.kind = FAULT_NONE;
    block_params(v, &p);
    block_inputs(v, &u);
    block_load(state, &x, &fault);
    block_step(&p, &x, &u, h, &y, &fault);
    block_save(&y, after);
    return reported(&fault, type, text);
}

int shim_outputs(const double *v, const double *state, double *outputs, char *type, char *text)
{
    BlockParams p;
    BlockInputs u;
    BlockState x;
    BlockOutputs y;
    Fault fault;
    fault.kind = FAULT_NONE;
    block_params(v, &p);
    block_inputs(v, &u);
    block_load(state, &x, &fault);
    block_outputs(&p, &x, &u, &y, &fault);
    block_outputs_to(&y, outputs);
    return reported(&fault, type, text);
}
