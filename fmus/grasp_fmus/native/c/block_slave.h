/* A block as a slave: it calculates, and its states can be saved, also as bytes.

   Before it is included: block.h, and what slave.h needs, but for N_TEXTS and Model; and
       SLAVE_GET_STATE      the function that gets a state
       CONTENT              the hash of the Python FMU of this block, which is in states */
#ifndef BLOCK_SLAVE_H
#define BLOCK_SLAVE_H

#include <float.h>

#include "blake2b.h"

#define SLAVE_HAS_STATES 1
#define N_TEXTS 0
static const char *const texts[N_TEXTS + 1] = {""};

typedef struct {
    BlockParams params;
    BlockInputs inputs;
    BlockState state;
} Model;

#include "slave.h"

#define SLAVE_CONTENT_SIZE 16
#define SLAVE_HEAD 40  /* bytes of a state before its numbers: magic, content, check sum */
#define SLAVE_STATE_SIZE (SLAVE_HEAD + 8 * (2 + N_INPUTS + N_PARAMETERS + N_STATE))

/* A state of a slave at a moment: everything else follows from it */
typedef struct {
    char tag[8 + SLAVE_CONTENT_SIZE];  /* tells it from states of other FMUs and from freed ones */
    int phase;
    double values[N_VARIABLES + 1];
    BlockState state;
} Snapshot;

static const char slave_magic[] = "graspFMU";

/* The block */

/* All of it has a value: compilers do not see that type and text are read after a fault only. */
static void slave_no_fault(Fault *fault)
{
    fault->kind = FAULT_NONE;
    fault->type = "";
    fault->text[0] = '\0';
}

/* The last line of what Python's traceback would be */
static Status slave_refuse_fault(Slave *s, const Fault *fault)
{
    slave_begin_text(s);
    slave_put(s, fault->type);
    slave_put(s, fault->text[0] ? ": " : "");
    slave_put(s, fault->text);
    return slave_refused(s);
}

/* Parameters that do not go together are refused */
static Status slave_read_params(Slave *s)
{
    Fault fault;
    slave_no_fault(&fault);
    block_params(s->values, &s->model.params);
    block_check(&s->model.params, &fault);
    s->params_are_read = fault.kind == FAULT_NONE;
    if (s->params_are_read) {
        return SLAVE_OK;
    }
    return fault.kind == FAULT_VALUE ? slave_refuse(s, fault.text) : slave_refuse_fault(s, &fault);
}

static int slave_outputs_are_finite(const double *outputs)
{
    double sum = 0.0;
    int i;
    for (i = 0; i < N_OUTPUTS; i++) {
        sum += outputs[i];
    }
    for (i = 0; i < N_OUTPUTS && !slave_finite(sum); i++) {
        if (!slave_finite(outputs[i])) {
            return 0;
        }
    }
    return 1;
}

static void slave_put_not_finite(Slave *s, const double *outputs)
{
    const char *separator = "";
    int i;
    for (i = 0; i < N_OUTPUTS; i++) {
        if (!slave_finite(outputs[i])) {
            slave_put(s, separator);
            slave_put(s, variables[N_INPUTS + i].name);
            slave_put(s, " = ");
            slave_put_number(s, outputs[i]);
            slave_put(s, variables[N_INPUTS + i].in_unit);
            separator = ", ";
        }
    }
    slave_put(s, ": must be finite");
}

/* Work out the outputs; before the end of initialisation the initial state as well */
static Status slave_refresh(Slave *s)
{
    double outputs[N_OUTPUTS + 1];
    BlockState state;
    BlockOutputs y;
    Fault fault;
    if (!s->params_are_read && slave_read_params(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    slave_no_fault(&fault);
    block_inputs(s->values, &s->model.inputs);
    if (s->phase < STEPPING) {
        block_initial_state(&s->model.params, &s->model.inputs, &state, &fault);
        if (fault.kind == FAULT_NONE) {
            s->model.state = state;
        }
    }
    if (fault.kind == FAULT_NONE) {
        block_outputs(&s->model.params, &s->model.state, &s->model.inputs, &y, &fault);
    }
    if (fault.kind != FAULT_NONE) {
        return slave_refuse_fault(s, &fault);
    }
    block_outputs_to(&y, outputs);
    if (!slave_outputs_are_finite(outputs)) {
        slave_begin_text(s);
        slave_put_not_finite(s, outputs);
        return slave_refused(s);
    }
    memcpy(s->values + N_INPUTS, outputs, N_OUTPUTS * sizeof *outputs);
    s->outputs_follow = 1;
    return SLAVE_OK;
}

/* The life cycle */

/* Why this machine code would not calculate as Python does; NULL if it does. The operands are
   opaque, the expressions are not: the compiler makes of them what it makes of the block's. */
static const char *slave_arithmetic_fault(void)
{
    volatile double opaque[] = {1.0 + 1.0 / 1073741824.0, 1.0 - 1.0 / 1073741824.0, -1.0,
                                DBL_MAX, 10.0, -0.0, DBL_MIN, 1e-20, 1.0};
    double a = opaque[0], b = opaque[1], c = opaque[2];
    double huge = opaque[3], ten = opaque[4], minus_zero = opaque[5], tiny = opaque[6];
    double small = opaque[7], one = opaque[8];
    double infinite = huge * ten, none = infinite - infinite, zero = minus_zero + 0.0;
    volatile double halved = tiny / ten;
    if (a * b + c != 0.0) {
        return "a * b + c is not rounded twice: must be compiled with -ffp-contract=off, and on "
               "32 bit x86 with -msse2 -mfpmath=sse";
    }
    if (none == none || infinite - infinite == 0.0 || huge - huge != 0.0 || one / zero < 0.0
        || (small + one) - one != 0.0) {
        return "infinity, NaN, -0.0 and sums are not those of IEEE 754: must be compiled without "
               "-ffast-math and -Ofast (MSVC: /fp:precise)";
    }
    if (halved == 0.0) {
        return "numbers below 2.3e-308 become 0: must be compiled and linked without -ffast-math, "
               "and the host must not have the processor do so";
    }
    return NULL;
}

/* As new: the start values, the state that follows from them */
static Status slave_start(Slave *s)
{
    Fault fault;
    const char *wrong = slave_arithmetic_fault();
    if (wrong) {
        return slave_refuse(s, wrong);
    }
    slave_start_values(s);
    slave_no_fault(&fault);
    block_params(s->values, &s->model.params);
    block_inputs(s->values, &s->model.inputs);
    block_check(&s->model.params, &fault);
    if (fault.kind == FAULT_NONE) {
        block_initial_state(&s->model.params, &s->model.inputs, &s->model.state, &fault);
    }
    return fault.kind == FAULT_NONE ? SLAVE_OK : slave_refuse_fault(s, &fault);
}

static Status slave_enter_initialisation(Slave *s)
{
    return slave_go_on(s);
}

/* Nothing that a block has needs an end */
static void slave_end(Slave *s)
{
    (void)s;
}

/* Steps */

/* Arithmetic that fails in a step discards it; any other fault is an error */
static Status slave_end_step(Slave *s, double h, const Fault *fault)
{
    if (fault->kind != FAULT_OWN && fault->kind != FAULT_ARITHMETIC) {
        return slave_refuse_fault(s, fault);
    }
    slave_begin_discard(s, h);
    if (fault->kind == FAULT_ARITHMETIC) {
        slave_put(s, fault->type);
        slave_put(s, ": ");
        slave_put(s, fault->text);
        slave_put(s, ": must be finite");
    } else {
        slave_put(s, fault->text);
    }
    return slave_discarded(s);
}

/* Advance the block by h seconds with the inputs as they are; it stays where it is if not OK */
static Status slave_do_step(Slave *s, double time, double h)
{
    double outputs[N_OUTPUTS + 1];
    double apart = time - s->values[SLAVE_TIME];
    BlockState after;
    BlockOutputs y;
    Fault fault;
    if (!(s->phase == STEPPING && 0.0 < h && h <= DBL_MAX && -SLAVE_TIME_TOLERANCE <= apart
          && apart <= SLAVE_TIME_TOLERANCE)
        && slave_check_step(s, time, h) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (h > BLOCK_LONGEST_STEP) {
        slave_begin_discard(s, h);
        slave_put(s, "must be at most ");
        slave_put_general(s, BLOCK_LONGEST_STEP, 6);
        slave_put(s, " s");
        return slave_discarded(s);
    }
    if (!s->outputs_follow) {
        if (!s->params_are_read && slave_read_params(s) != SLAVE_OK) {
            return SLAVE_ERROR;
        }
        block_inputs(s->values, &s->model.inputs);
    }
    slave_no_fault(&fault);
    block_step(&s->model.params, &s->model.state, &s->model.inputs, h, &after, &fault);
    if (fault.kind == FAULT_NONE) {
        block_outputs(&s->model.params, &after, &s->model.inputs, &y, &fault);
    }
    if (fault.kind != FAULT_NONE) {
        return slave_end_step(s, h, &fault);
    }
    block_outputs_to(&y, outputs);
    if (!slave_outputs_are_finite(outputs)) {
        slave_begin_discard(s, h);
        slave_put_not_finite(s, outputs);
        return slave_discarded(s);
    }
    s->model.state = after;
    memcpy(s->values + N_INPUTS, outputs, N_OUTPUTS * sizeof *outputs);
    s->values[SLAVE_TIME] = time + h;
    s->outputs_follow = 1;
    return SLAVE_OK;
}

/* States */

static const char slave_tag[] = "graspFMU" CONTENT;

static Status slave_check_state(Slave *s, const Snapshot *state)
{
    if (!state) {
        return slave_refuse(s, "state NULL: must be one of " SLAVE_FMI SLAVE_GET_STATE);
    }
    if (memcmp(state->tag, slave_tag, sizeof state->tag) != 0) {
        return slave_refuse(s, "state of another FMU: must be of this one, " CONTENT);
    }
    return SLAVE_OK;
}

/* Save into a state, new memory or one of this FMU */
static void slave_save(const Slave *s, Snapshot *state)
{
    memcpy(state->tag, slave_tag, sizeof state->tag);
    state->phase = s->phase;
    memcpy(state->values, s->values, sizeof state->values);
    state->state = s->model.state;
}

/* So that a state freed twice is told from one */
static void slave_forget(Snapshot *state)
{
    volatile char *tag = state->tag;  /* the compiler may not leave it out */
    *tag = '\0';
}

static Status slave_restore(Slave *s, const Snapshot *state)
{
    if (slave_check_state(s, state) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    memcpy(s->values, state->values, sizeof s->values);
    s->model.state = state->state;
    s->phase = state->phase;
    s->params_are_read = s->outputs_follow = 0;
    return SLAVE_OK;
}

static void slave_number_to_bytes(double v, unsigned char *bytes)
{
    uint64_t bits;
    int i;
    memcpy(&bits, &v, sizeof bits);
    for (i = 0; i < 8; i++) {
        bytes[i] = (unsigned char)(bits >> 8 * i);
    }
}

static double slave_number_from_bytes(const unsigned char *bytes)
{
    uint64_t bits = 0;
    double v;
    int i;
    for (i = 7; i >= 0; i--) {
        bits = bits << 8 | bytes[i];
    }
    memcpy(&v, &bits, sizeof v);
    return v;
}

static void slave_check_sum(const unsigned char *bytes, unsigned char *sum)
{
    Blake2b hash;
    blake2b_begin(&hash);
    blake2b_add(&hash, CONTENT, SLAVE_CONTENT_SIZE);
    blake2b_add(&hash, bytes + SLAVE_HEAD, SLAVE_STATE_SIZE - SLAVE_HEAD);
    blake2b_end(&hash, sum);
}

static int slave_is_output(int vr)
{
    return vr >= N_INPUTS && vr < N_INPUTS + N_OUTPUTS;
}

static void slave_put_count(Slave *s, size_t n)
{
    slave_put_general(s, (double)n, TEXT_WHOLE);
}

/* To SLAVE_STATE_SIZE bytes, the same on every machine and as the Python slave's */
static Status slave_serialise(Slave *s, const Snapshot *state, unsigned char *bytes, size_t size)
{
    double numbers[N_STATE + 1];
    unsigned char *at = bytes + SLAVE_HEAD;
    int i;
    if (slave_check_state(s, state) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (size < SLAVE_STATE_SIZE) {
        slave_begin_text(s);
        slave_put(s, "memory of ");
        slave_put_count(s, size);
        slave_put(s, " bytes for a state: must have ");
        slave_put_count(s, SLAVE_STATE_SIZE);
        return slave_refused(s);
    }
    memcpy(bytes, slave_tag, sizeof state->tag);
    slave_number_to_bytes(state->phase, at);
    slave_number_to_bytes(state->values[SLAVE_TIME], at += 8);
    for (i = 0; i < N_VARIABLES; i++) {
        if (!slave_is_output(i)) {
            slave_number_to_bytes(state->values[i], at += 8);
        }
    }
    block_save(&state->state, numbers);
    for (i = 0; i < N_STATE; i++) {
        slave_number_to_bytes(numbers[i], at += 8);
    }
    slave_check_sum(bytes, bytes + SLAVE_HEAD - BLAKE2B_SIZE);
    return SLAVE_OK;
}

/* Bytes of a state that should be letters, as bytes.decode("ascii", "replace") */
static void slave_put_bytes(Slave *s, const unsigned char *bytes, size_t n)
{
    char character[2] = "";
    size_t i;
    for (i = 0; i < n; i++) {
        character[0] = (char)bytes[i];
        slave_put(s, bytes[i] > 0 && bytes[i] < 0x80 ? character : "\xef\xbf\xbd");
    }
}

/* What bytes must be for a state to be read from them */
static Status slave_check_bytes(Slave *s, const unsigned char *bytes, size_t size)
{
    unsigned char sum[BLAKE2B_SIZE];
    if (size < 8 || memcmp(bytes, slave_magic, 8) != 0) {
        slave_begin_text(s);
        slave_put(s, "state of ");
        slave_put_count(s, size);
        slave_put(s, " bytes: must begin with b'graspFMU'");
        return slave_refused(s);
    }
    if (size < sizeof slave_tag - 1 || memcmp(bytes, slave_tag, sizeof slave_tag - 1) != 0) {
        slave_begin_text(s);
        slave_put(s, "state of the FMU with content ");
        slave_put_bytes(s, bytes + 8, (size < sizeof slave_tag ? size : sizeof slave_tag - 1) - 8);
        slave_put(s, ": must be of this one, " CONTENT);
        return slave_refused(s);
    }
    if (size != SLAVE_STATE_SIZE) {
        slave_begin_text(s);
        slave_put(s, "state of ");
        slave_put_count(s, size);
        slave_put(s, " bytes: must have ");
        slave_put_count(s, SLAVE_STATE_SIZE);
        return slave_refused(s);
    }
    slave_check_sum(bytes, sum);
    if (memcmp(bytes + SLAVE_HEAD - BLAKE2B_SIZE, sum, BLAKE2B_SIZE) != 0) {
        return slave_refuse(s, "state with a wrong check sum: must be as it was written");
    }
    return SLAVE_OK;
}

/* Whether a number has a whole part, and the text of what Python raises if it has none */
static const char *slave_not_whole(double v)
{
    return v != v ? "cannot convert float NaN to integer"
           : !slave_finite(v) ? "cannot convert float infinity to integer" : NULL;
}

static double slave_whole(double v)
{
    return (v < 0.0 ? ceil(v) : floor(v)) + 0.0;  /* -0.0 becomes 0.0 */
}

/* The values in checked bytes; what Python would not convert is refused */
static Status slave_values_from_bytes(Slave *s, const unsigned char *at, double *values)
{
    const char *fault = NULL;
    int i;
    for (i = 0; i < N_VARIABLES; i++) {
        double v;
        if (slave_is_output(i)) {
            continue;
        }
        v = slave_number_from_bytes(at);
        at += 8;
        if (variables[i].kind == KIND_INTEGER) {
            fault = slave_not_whole(v);
            v = fault ? 0.0 : slave_whole(v);
        }
        if (fault) {
            return slave_refuse(s, fault);
        }
        values[i] = variables[i].kind == KIND_BOOLEAN ? v != 0.0 : v;
    }
    return SLAVE_OK;
}

/* A state from bytes; `state` is not one while they are refused */
static Status slave_deserialise(Slave *s, const unsigned char *bytes, size_t size, Snapshot *state)
{
    const unsigned char *at = bytes + SLAVE_HEAD;
    double numbers[N_STATE + 1], phase;
    Fault fault;
    int i;
    memset(state, 0, sizeof *state);
    if (slave_check_bytes(s, bytes, size) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    phase = slave_number_from_bytes(at);
    if (slave_not_whole(phase)) {
        return slave_refuse(s, slave_not_whole(phase));
    }
    phase = slave_whole(phase);
    state->values[SLAVE_TIME] = slave_number_from_bytes(at += 8);
    if (slave_values_from_bytes(s, at += 8, state->values) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    at += 8 * (N_INPUTS + N_PARAMETERS);
    for (i = 0; i < N_STATE; i++) {
        numbers[i] = slave_number_from_bytes(at + 8 * i);
    }
    slave_no_fault(&fault);
    block_load(numbers, &state->state, &fault);
    if (fault.kind != FAULT_NONE) {
        return slave_refuse(s, fault.text);
    }
    for (i = 0; i < N_VARIABLES; i++) {
        if (!slave_is_output(i) && !slave_in_range((uint32_t)i, state->values[i])) {
            return slave_refuse_value(s, (uint32_t)i, state->values[i]);
        }
    }
    if (phase < INSTANTIATED || phase > TERMINATED || !slave_finite(state->values[SLAVE_TIME])) {
        slave_begin_text(s);
        slave_put(s, "state in phase ");
        slave_put_general(s, phase, TEXT_WHOLE);
        slave_put(s, " at ");
        slave_put_number(s, state->values[SLAVE_TIME]);
        slave_put(s, " s: is none");
        return slave_refused(s);
    }
    state->phase = (int)phase;
    memcpy(state->tag, slave_tag, sizeof state->tag);
    return SLAVE_OK;
}

#endif
