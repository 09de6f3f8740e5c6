/* A block as a slave: it calculates, and its states can be saved, also as bytes.

   Before it is included: block.h, and what slave.h needs but for what is defined here; and
       CONTENT   the hash of the Python FMU of this block, 16 characters, which is in states */
#ifndef BLOCK_SLAVE_H
#define BLOCK_SLAVE_H

#define SLAVE_HAS_STATES 1
#define SLAVE_LONGEST_STEP ((double)BLOCK_LONGEST_STEP)
#define N_TEXTS 0
static const char *const texts[N_TEXTS + 1] = {""};

typedef struct {
    BlockParams params;
    BlockInputs inputs;
    BlockState states[2];  /* the one that counts, and room for the one after a step */
    int at;
} Model;

#include "slave.h"

/* The block */

static BlockState *slave_state(Slave *s)
{
    return &s->model.states[s->model.at];
}

/* Parameters that do not go together are refused */
static Status slave_read_params(Slave *s)
{
    Text why;
    text_clear(&why);
    block_params(s->values, &s->model.params);
    s->params_are_read = block_check(&s->model.params, &why);
    return s->params_are_read ? SLAVE_OK : slave_refuse(s, "%s", why.at);
}

/* Inputs that the block cannot take are refused */
static Status slave_read_inputs(Slave *s)
{
    Text why;
    text_clear(&why);
    block_inputs(s->values, &s->model.inputs);
    if (block_check_inputs(&s->model.params, &s->model.inputs, &why)) {
        return SLAVE_OK;
    }
    return slave_refuse(s, "%s", why.at);
}

static int slave_outputs_are_finite(const double *outputs)
{
    double sum = 0.0;
    int i;
    for (i = 0; i < N_OUTPUTS; i++) {
        sum += outputs[i] - outputs[i];  /* NaN where one is not */
    }
    return sum == 0.0;
}

static void slave_put_not_finite(Text *said, const double *outputs)
{
    const char *separator = "";
    int i;
    for (i = 0; i < N_OUTPUTS; i++) {
        if (!slave_finite(outputs[i])) {
            text_put(said, separator);
            slave_put_value(said, &variables[N_INPUTS + i], outputs[i]);
            separator = ", ";
        }
    }
    text_put(said, ": must be finite");
}

/* Work out the outputs; before the end of initialisation the initial state as well */
static Status slave_refresh(Slave *s)
{
    double outputs[N_OUTPUTS + 1];
    BlockOutputs y;
    if (!s->params_are_read && slave_read_params(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (slave_read_inputs(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (s->phase < STEPPING) {
        block_initial_state(&s->model.params, &s->model.inputs, slave_state(s));
    }
    block_outputs(&s->model.params, slave_state(s), &s->model.inputs, &y);
    block_outputs_to(&y, outputs);
    if (!slave_outputs_are_finite(outputs)) {
        slave_put_not_finite(slave_say(s), outputs);
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
    const char *wrong = slave_arithmetic_fault();
    if (wrong) {
        return slave_refuse(s, "%s", wrong);
    }
    slave_start_values(s);
    block_inputs(s->values, &s->model.inputs);
    if (slave_read_params(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    block_initial_state(&s->model.params, &s->model.inputs, slave_state(s));
    return SLAVE_OK;
}

static Status slave_enter_initialisation(Slave *s)
{
    return slave_go_on(s);
}

/* Nothing that a block holds needs an end */
static void slave_end(Slave *s)
{
    (void)s;
}

/* Steps */

/* Advance the block by h seconds with the inputs as they are; it stays where it is if not OK */
static Status slave_do_step(Slave *s, double time, double h)
{
    double outputs[N_OUTPUTS + 1];
    BlockState *after = &s->model.states[!s->model.at];
    BlockOutputs y;
    Status status = slave_check_step(s, time, h);
    if (status != SLAVE_OK) {
        return status;
    }
    if (!s->outputs_follow) {
        if (!s->params_are_read && slave_read_params(s) != SLAVE_OK) {
            return SLAVE_ERROR;
        }
        if (slave_read_inputs(s) != SLAVE_OK) {
            return SLAVE_ERROR;
        }
    }
    block_step(&s->model.params, slave_state(s), &s->model.inputs, h, after);
    block_outputs(&s->model.params, after, &s->model.inputs, &y);
    block_outputs_to(&y, outputs);
    if (!slave_outputs_are_finite(outputs)) {
        slave_put_not_finite(slave_say_step(s, h), outputs);
        return slave_discarded(s);
    }
    s->model.at = !s->model.at;
    memcpy(s->values + N_INPUTS, outputs, N_OUTPUTS * sizeof *outputs);
    s->values[SLAVE_TIME] = time + h;
    s->outputs_follow = 1;
    return SLAVE_OK;
}

/* States. What the host gets is the bytes that are also those of the Python slave, the same on every
   machine: a tag, then numbers, little-endian, from which all else follows */

enum { STATE_PHASE, STATE_TIME, STATE_VALUES };  /* inputs, then parameters; then the block's state */
#define STATE_BLOCK (STATE_VALUES + N_INPUTS + N_PARAMETERS)
#define STATE_TAG 24
#define STATE_SIZE ((size_t)(STATE_TAG + 8 * (STATE_BLOCK + N_STATE)))

static const char state_tag[] = "graspFMU" CONTENT;

static void state_put(unsigned char *state, int number, double value)
{
    uint64_t bits;
    int i;
    memcpy(&bits, &value, sizeof bits);
    for (i = 0; i < 8; i++) {
        state[STATE_TAG + 8 * number + i] = (unsigned char)(bits >> 8 * i);
    }
}

static double state_number(const unsigned char *state, int number)
{
    uint64_t bits = 0;
    double value;
    int i;
    for (i = 0; i < 8; i++) {
        bits |= (uint64_t)state[STATE_TAG + 8 * number + i] << 8 * i;
    }
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* The variable whose value is the i-th in a state */
static int state_variable(int i)
{
    return i < N_INPUTS ? i : i + N_OUTPUTS;
}

static Status slave_check_state(Slave *s, const void *state)
{
    if (!state) {
        return slave_refuse(s, "state NULL: must be one of " SLAVE_FMI SLAVE_GET_STATE);
    }
    if (memcmp(state, state_tag, STATE_TAG) != 0) {
        return slave_refuse(s, "state of another FMU: must be of this one, " CONTENT);
    }
    return SLAVE_OK;
}

static Status slave_new_state(Slave *s, void **place)
{
    *place = slave_allocate(&s->host, STATE_SIZE);
    return *place ? SLAVE_OK : slave_refuse(s, "there is no memory for a state");
}

/* Save into new memory, or into the state that is there already */
static Status slave_get_state(Slave *s, void **place)
{
    Status status = *place ? slave_check_state(s, *place) : slave_new_state(s, place);
    double numbers[N_STATE + 1];
    unsigned char *state = (unsigned char *)*place;
    int i;
    if (status != SLAVE_OK) {
        return status;
    }
    memcpy(state, state_tag, STATE_TAG);
    state_put(state, STATE_PHASE, s->phase);
    state_put(state, STATE_TIME, s->values[SLAVE_TIME]);
    for (i = 0; i < N_INPUTS + N_PARAMETERS; i++) {
        state_put(state, STATE_VALUES + i, s->values[state_variable(i)]);
    }
    block_save(slave_state(s), numbers);
    for (i = 0; i < N_STATE; i++) {
        state_put(state, STATE_BLOCK + i, numbers[i]);
    }
    return SLAVE_OK;
}

static Status slave_set_state(Slave *s, const void *memory)
{
    const unsigned char *state = (const unsigned char *)memory;
    double numbers[N_STATE + 1], phase;
    int i;
    if (slave_check_state(s, state) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    phase = state_number(state, STATE_PHASE);
    s->phase = (int)phase;
    s->values[SLAVE_TIME] = state_number(state, STATE_TIME);
    for (i = 0; i < N_INPUTS + N_PARAMETERS; i++) {
        s->values[state_variable(i)] = state_number(state, STATE_VALUES + i);
    }
    for (i = 0; i < N_STATE; i++) {
        numbers[i] = state_number(state, STATE_BLOCK + i);
    }
    block_load(numbers, slave_state(s));
    s->params_are_read = s->outputs_follow = 0;
    return SLAVE_OK;
}

static Status slave_free_state(Slave *s, void **place)
{
    if (place && *place) {
        if (slave_check_state(s, *place) != SLAVE_OK) {
            return SLAVE_ERROR;
        }
        slave_release(&s->host, *place);
        *place = NULL;
    }
    return SLAVE_OK;
}

static Status slave_state_size(Slave *s, const void *state, size_t *size)
{
    *size = STATE_SIZE;
    return slave_check_state(s, state);
}

static Status slave_refuse_size(Slave *s, size_t size)
{
    return slave_refuse(s, "state of %d bytes: must have %d", (int)size, (int)STATE_SIZE);
}

static Status slave_serialise(Slave *s, const void *state, void *bytes, size_t size)
{
    if (slave_check_state(s, state) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (size < STATE_SIZE) {
        return slave_refuse_size(s, size);
    }
    memcpy(bytes, state, STATE_SIZE);
    return SLAVE_OK;
}

static int slave_may_be(const Variable *v, double value)
{
    return slave_in_range(v, value)
           && (v->kind == KIND_REAL
               || value == (v->kind == KIND_BOOLEAN ? value != 0.0 : floor(value)));
}

/* That bytes could be those of an instance of this FMU */
static Status slave_check_bytes(Slave *s, const unsigned char *bytes, size_t size)
{
    double phase, time;
    int i;
    if (size >= STATE_TAG && slave_check_state(s, bytes) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (size != STATE_SIZE) {
        return slave_refuse_size(s, size);
    }
    for (i = 0; i < N_INPUTS + N_PARAMETERS; i++) {
        const Variable *v = &variables[state_variable(i)];
        double value = state_number(bytes, STATE_VALUES + i);
        if (!slave_may_be(v, value)) {
            return slave_refuse_value(s, v, value);
        }
    }
    phase = state_number(bytes, STATE_PHASE);
    time = state_number(bytes, STATE_TIME);
    if (INSTANTIATED <= phase && phase <= TERMINATED && phase == floor(phase)
        && slave_finite(time)) {
        return SLAVE_OK;
    }
    return slave_refuse(s, "state in phase %.17g at %.17g s: is none", phase, time);
}

/* A new state from bytes */
static Status slave_deserialise(Slave *s, const void *bytes, size_t size, void **place)
{
    void *state;
    if (slave_check_bytes(s, (const unsigned char *)bytes, size) != SLAVE_OK
        || slave_new_state(s, &state) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    *place = memcpy(state, bytes, STATE_SIZE);
    return SLAVE_OK;
}

#endif
