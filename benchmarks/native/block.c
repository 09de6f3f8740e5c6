/* What a step of a block costs: step, outputs, as its FMU does them.
 *
 *   block ROUNDS [REFERENCE=VALUE ...]
 *
 * Runs through the inputs in rows.h, each held for HELD steps, with parameters as given, and prints
 * the CPU time of a step in ns, mean of the run, for each round; then the sum of the outputs.
 */
#define _POSIX_C_SOURCE 199309L
#include "block.h"
#include "rows.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

int main(int count, char **given)
{
    static double v[N_VARIABLES];
    double sum = 0.0;
    BlockParams p;
    int i, round, rounds = atoi(given[1]);
    for (i = 0; i < N_VARIABLES; ++i)
        v[i] = variables[i].start;
    for (i = 2; i < count; ++i) {
        char *value;
        long reference = strtol(given[i], &value, 10);
        v[reference] = strtod(value + 1, NULL);
    }
    block_params(v, &p);
    for (round = 0; round < rounds; ++round) {
        BlockInputs u;
        BlockState x;
        BlockOutputs y;
        double began;
        int row, step;
        block_inputs(rows[0], &u);
        block_initial_state(&p, &u, &x);
        began = now();
        for (row = 0; row < ROWS; ++row) {
            block_inputs(rows[row], &u);
            for (step = 0; step < HELD; ++step) {
                block_step(&p, &x, &u, H, &x);
                block_outputs(&p, &x, &u, &y);
                block_outputs_to(&y, v + N_INPUTS);
                sum += v[N_INPUTS];
            }
        }
        printf("%.1f\n", (now() - began) / (ROWS * HELD));
    }
    printf("%g\n", sum);
    return 0;
}
