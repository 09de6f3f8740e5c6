/* The functions of a block without faults, over those of a block.h with them: where a block had one,
   its state and outputs are not finite. */
#ifndef OLD_BLOCK_H
#define OLD_BLOCK_H

static void old_no_fault(Fault *fault)
{
    fault->kind = FAULT_NONE;
    fault->type = "";
    fault->text[0] = '\0';
}

static int old_check(const BlockParams *p, Text *why)
{
    Fault fault;
    old_no_fault(&fault);
    block_check(p, &fault);
    text_put(why, fault.text);
    return fault.kind == FAULT_NONE;
}

static void old_load(const double *numbers, BlockState *x)
{
    Fault fault;
    old_no_fault(&fault);
    block_load(numbers, x, &fault);
}

static void old_not_finite(const Fault *fault, BlockState *x)
{
    double numbers[N_STATE + 1];
    int i;
    for (i = 0; fault->kind != FAULT_NONE && i < N_STATE; i++) {
        numbers[i] = NAN;
    }
    if (fault->kind != FAULT_NONE) {
        old_load(numbers, x);
    }
}

static void old_initial_state(const BlockParams *p, const BlockInputs *u, BlockState *x)
{
    Fault fault;
    old_no_fault(&fault);
    block_initial_state(p, u, x, &fault);
    old_not_finite(&fault, x);
}

static void old_step(const BlockParams *p, const BlockState *x, const BlockInputs *u, double h,
                     BlockState *after)
{
    Fault fault;
    old_no_fault(&fault);
    block_step(p, x, u, h, after, &fault);
    old_not_finite(&fault, after);
}

static int old_fails;

static void old_outputs(const BlockParams *p, const BlockState *x, const BlockInputs *u,
                        BlockOutputs *y)
{
    Fault fault;
    old_no_fault(&fault);
    block_outputs(p, x, u, y, &fault);
    old_fails = fault.kind != FAULT_NONE;
}

static void old_outputs_to(const BlockOutputs *y, double *values)
{
    int i;
    block_outputs_to(y, values);
    for (i = 0; old_fails && i < N_OUTPUTS; i++) {
        values[i] = NAN;
    }
}

#define block_check old_check
#define block_load old_load
#define block_initial_state old_initial_state
#define block_step old_step
#define block_outputs old_outputs
#define block_outputs_to old_outputs_to

#endif
