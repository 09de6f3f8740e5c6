/* The functions of block.h as functions of plain numbers, for ctypes. */
#include "block.h"

void sizes(int *found)
{
    found[0] = N_VARIABLES;
    found[1] = N_OUTPUTS;
    found[2] = N_STATE;
}

int check(const double *values, char *reason)
{
    BlockParams p;
    Text why;
    int good;
    text_clear(&why);
    block_params(values, &p);
    good = block_check(&p, &why);
    strcpy(reason, why.at);
    return good;
}

void initial_state(const double *values, double *numbers)
{
    BlockParams p;
    BlockInputs u;
    BlockState x;
    block_params(values, &p);
    block_inputs(values, &u);
    block_initial_state(&p, &u, &x);
    block_save(&x, numbers);
}

void step(const double *values, double h, double *numbers)
{
    BlockParams p;
    BlockInputs u;
    BlockState x;
    block_params(values, &p);
    block_inputs(values, &u);
    block_load(numbers, &x);
    block_step(&p, &x, &u, h, &x);
    block_save(&x, numbers);
}

void outputs(const double *values, const double *numbers, double *seen)
{
    BlockParams p;
    BlockInputs u;
    BlockState x;
    BlockOutputs y;
    block_params(values, &p);
    block_inputs(values, &u);
    block_load(numbers, &x);
    block_outputs(&p, &x, &u, &y);
    block_outputs_to(&y, seen);
}
