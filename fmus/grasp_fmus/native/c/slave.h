/* A block as a co-simulation slave: life cycle, checks, texts, states. It does, call by call, what
   the Python slave of the same block does, to the byte; a call that is refused has no effect.

   Before it is included: block.h; the types Host, what an instance knows of its host, and Status,
   that of FMI; and
       SLAVE_OK, _DISCARD, _ERROR       of Status
       SLAVE_FMI            "fmi2" or "fmi3", for the names of functions in texts
       SLAVE_PER_CENT       how the host's logger wants a % in a text
       SLAVE_REAL, _BOOLEAN, _INTEGER   what this FMI calls the kinds of variables
       SLAVE_TOKEN, SLAVE_GET_STATE     and the GUID, and the function that gets a state
       N_REFERENCES         N_VARIABLES, or one more, the time
       TOKEN, CONTENT       the GUID; the hash of the Python FMU of this block, which is in states
   The interface defines slave_log(), which gives the message s->text to the host. */
#ifndef SLAVE_H
#define SLAVE_H

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "blake2b.h"
#include "number_text.h"

enum { INSTANTIATED, INITIALISING, STEPPING, TERMINATED };     /* phases */

#define SLAVE_TIME N_VARIABLES  /* the place of the time, in s, behind the values */
#define SLAVE_TIME_TOLERANCE 1e-9  /* how far the host's clock may be off, in s; or 1e-12 of it */
#define SLAVE_CONTENT_SIZE 16
#define SLAVE_HEAD 40  /* bytes of a state before its numbers: magic, content, check sum */
#define SLAVE_STATE_SIZE (SLAVE_HEAD + 8 * (2 + N_INPUTS + N_PARAMETERS + N_STATE))

typedef struct {
    Host host;
    const char *name;     /* as the host gave it */
    double values[N_VARIABLES + 1];
    int phase;
    int params_are_read;  /* 0: one was set, and they are to be read again */
    int outputs_follow;   /* 0: something was set, and the outputs are out of date */
    BlockParams params;
    BlockInputs inputs;
    BlockState state;
    char *text, *text_at, *text_end;  /* a message: its begin, its end, that of its memory */
} Slave;

/* A state of a slave at a moment: everything else follows from it */
typedef struct {
    char tag[8 + SLAVE_CONTENT_SIZE];  /* tells it from states of other FMUs and from freed ones */
    int phase;
    double values[N_VARIABLES + 1];
    BlockState state;
} Snapshot;

static const char slave_magic[] = "graspFMU";
static const char *const slave_phases[] = {"before initialisation", "in initialisation mode",
                                           "in step mode", "after " SLAVE_FMI "Terminate"};
static const char *const slave_kinds[] = {SLAVE_REAL, SLAVE_BOOLEAN, SLAVE_INTEGER};

static void slave_log(const Slave *s, Status status);

/* Texts */

static void slave_put(Slave *s, const char *text)
{
    for (; *text; text++) {
        const char *c = *text == '%' ? SLAVE_PER_CENT : text;
        size_t n = *text == '%' ? sizeof SLAVE_PER_CENT - 1 : 1;
        if ((size_t)(s->text_end - s->text_at) > n) {
            memcpy(s->text_at, c, n);
            s->text_at += n;
        }
    }
    *s->text_at = '\0';
}

/* Bytes that may be no UTF-8, with U+FFFD for what is none, as bytes.decode(errors="replace") */
static void slave_put_decoded(Slave *s, const char *text)
{
    const unsigned char *at = (const unsigned char *)text;
    char character[5];
    while (*at) {
        unsigned char first = at[0], low = 0x80, high = 0xbf;
        size_t i = 1;
        size_t n = first < 0x80 ? 1 : first < 0xc2 ? 0 : first < 0xe0 ? 2 : first < 0xf0 ? 3
                   : first < 0xf5 ? 4 : 0;
        low = first == 0xe0 ? 0xa0 : first == 0xf0 ? 0x90 : low;
        high = first == 0xed ? 0x9f : first == 0xf4 ? 0x8f : high;
        while (i < n && at[i] >= (i == 1 ? low : 0x80) && at[i] <= (i == 1 ? high : 0xbf)) {
            i++;
        }
        if (i == n) {
            memcpy(character, at, n);
            character[n] = '\0';
            slave_put(s, character);
        } else {
            slave_put(s, "\xef\xbf\xbd");
        }
        at += i;
    }
}

static void slave_put_number(Slave *s, double v)
{
    char text[TEXT_SIZE];
    text_repr(text, v);
    slave_put(s, text);
}

static void slave_put_general(Slave *s, double v, int digits)
{
    char text[TEXT_SIZE];
    text_general(text, v, digits);
    slave_put(s, text);
}

/* As repr() of the value of a variable */
static void slave_put_value(Slave *s, int kind, double v)
{
    if (kind == KIND_BOOLEAN) {
        slave_put(s, v != 0.0 ? "True" : "False");
    } else if (kind == KIND_INTEGER) {
        slave_put_general(s, v, TEXT_WHOLE);
    } else {
        slave_put_number(s, v);
    }
}

static void slave_begin_text(Slave *s)
{
    s->text_at = s->text;
    slave_put_decoded(s, s->name);
    slave_put(s, ", t = ");
    slave_put_general(s, s->values[SLAVE_TIME], 9);
    slave_put(s, " s: ");
}

/* End a call with the text that was begun */
static Status slave_refused(Slave *s)
{
    slave_log(s, SLAVE_ERROR);
    return SLAVE_ERROR;
}

static Status slave_refuse(Slave *s, const char *text)
{
    slave_begin_text(s);
    slave_put(s, text);
    return slave_refused(s);
}

static Status slave_refuse_variable(Slave *s, const char *name, const char *text)
{
    slave_begin_text(s);
    slave_put(s, name);
    slave_put(s, text);
    return slave_refused(s);
}

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

/* The block */

static int slave_finite(double v)
{
    return v - v == 0.0;
}

/* Parameters that do not go together are refused */
static Status slave_read_params(Slave *s)
{
    Fault fault;
    slave_no_fault(&fault);
    block_params(s->values, &s->params);
    block_check(&s->params, &fault);
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
    block_inputs(s->values, &s->inputs);
    if (s->phase < STEPPING) {
        block_initial_state(&s->params, &s->inputs, &state, &fault);
        if (fault.kind == FAULT_NONE) {
            s->state = state;
        }
    }
    if (fault.kind == FAULT_NONE) {
        block_outputs(&s->params, &s->state, &s->inputs, &y, &fault);
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
    int i;
    for (i = 0; i < N_VARIABLES; i++) {
        s->values[i] = variables[i].start;
    }
    s->values[SLAVE_TIME] = 0.0;
    s->params_are_read = s->outputs_follow = 0;
    s->phase = INSTANTIATED;
    slave_no_fault(&fault);
    block_params(s->values, &s->params);
    block_inputs(s->values, &s->inputs);
    block_check(&s->params, &fault);
    if (fault.kind == FAULT_NONE) {
        block_initial_state(&s->params, &s->inputs, &s->state, &fault);
    }
    return fault.kind == FAULT_NONE ? SLAVE_OK : slave_refuse_fault(s, &fault);
}

/* Bytes of memory for an instance and its texts */
static size_t slave_size(const char *name)
{
    size_t text = 8192 + 3 * strlen(name);  /* three for a byte that is no UTF-8 */
    int i;
    for (i = N_INPUTS; i < N_INPUTS + N_OUTPUTS; i++) {
        text += strlen(variables[i].name) + strlen(variables[i].in_unit) + 16;
    }
    return sizeof(Slave) + strlen(name) + 1 + text * (sizeof SLAVE_PER_CENT - 1);
}

/* Make an instance in memory of slave_size(); what the host calls itself and its FMU is checked */
static Status slave_instantiate(Slave *s, const Host *host, const char *name, const char *token)
{
    char *copy = (char *)(s + 1);
    const char *fault = slave_arithmetic_fault();
    size_t size = slave_size(name);
    memset(s, 0, size);
    s->host = *host;
    s->name = strcpy(copy, name);
    s->text = copy + strlen(name) + 1;
    s->text_end = (char *)s + size;
    if (fault) {
        return slave_refuse(s, fault);
    }
    if (!token || strcmp(token, TOKEN) != 0) {
        slave_begin_text(s);
        slave_put(s, SLAVE_TOKEN " = ");
        slave_put(s, token ? token : "NULL");
        slave_put(s, ": must be that of this FMU, " TOKEN);
        return slave_refused(s);
    }
    return slave_start(s);
}

static Status slave_require(Slave *s, const char *call, int phase)
{
    if (s->phase == phase) {
        return SLAVE_OK;
    }
    slave_begin_text(s);
    slave_put(s, SLAVE_FMI);
    slave_put(s, call);
    slave_put(s, " ");
    slave_put(s, slave_phases[s->phase]);
    slave_put(s, ": must be ");
    slave_put(s, slave_phases[phase]);
    return slave_refused(s);
}

static Status slave_begin_at(Slave *s, double start)
{
    if (slave_finite(start)) {
        s->values[SLAVE_TIME] = start;
        return SLAVE_OK;
    }
    slave_begin_text(s);
    slave_put(s, "start time = ");
    slave_put_number(s, start);
    slave_put(s, " s: must be a finite number");
    return slave_refused(s);
}

/* From a phase to the next, if the values set so far go together */
static Status slave_go_on(Slave *s)
{
    Status status = slave_refresh(s);
    s->phase += status == SLAVE_OK;
    return status;
}

/* Values. First all references of a call are checked, then all values, then they are used. */

#if N_REFERENCES > N_VARIABLES
static const Variable slave_time = {"time", " s", KIND_REAL, OUTPUT, 0, 0, 0.0, 0.0, 0.0};
#define SLAVE_VARIABLE(vr) ((vr) < N_VARIABLES ? &variables[vr] : &slave_time)
#else
#define SLAVE_VARIABLE(vr) (&variables[vr])
#endif

static Status slave_refuse_reference(Slave *s, uint32_t vr, const char *text)
{
    slave_begin_text(s);
    slave_put(s, "value reference ");
    slave_put_general(s, vr < 0x80000000u ? (double)vr : (double)vr - 4294967296.0, 10);
    slave_put(s, text);
    return slave_refused(s);
}

/* Refuse variables of a type of which there are none */
static Status slave_refuse_type(Slave *s, const uint32_t *vrs, size_t n, const char *type)
{
    char text[64] = ": there is no ";
    if (n == 0) {
        return SLAVE_OK;
    }
    strcat(strcat(text, type), " variable");
    return slave_refuse_reference(s, vrs[0], text);
}

/* Refuse, as Python does, references of which one is out of range or of another kind */
static Status slave_refuse_references(Slave *s, const uint32_t *vrs, size_t n, int kind)
{
    const Variable *v;
    size_t i;
    uint32_t vr;
    for (vr = 0; vr < N_REFERENCES && SLAVE_VARIABLE(vr)->kind != kind; vr++) {
    }
    if (vr == N_REFERENCES) {
        return slave_refuse_type(s, vrs, n, slave_kinds[kind]);
    }
    for (i = 0; vrs[i] < N_REFERENCES && SLAVE_VARIABLE(vrs[i])->kind == kind; i++) {
    }
    if (vrs[i] >= N_REFERENCES) {
        char text[64] = ": must be from 0 to ";
        text_general(text + strlen(text), N_REFERENCES - 1, 10);
        return slave_refuse_reference(s, vrs[i], text);
    }
    v = SLAVE_VARIABLE(vrs[i]);
    slave_begin_text(s);
    slave_put(s, v->name);
    slave_put(s, ": accessed as ");
    slave_put(s, slave_kinds[kind]);
    slave_put(s, ": must be as ");
    slave_put(s, slave_kinds[v->kind]);
    return slave_refused(s);
}

/* Before variables are read: outputs follow what was set */
static Status slave_read(Slave *s, const uint32_t *vrs, size_t n, int kind)
{
    int outputs = 0;
    size_t i;
    for (i = 0; i < n; i++) {
        if (vrs[i] >= N_REFERENCES || SLAVE_VARIABLE(vrs[i])->kind != kind) {
            return slave_refuse_references(s, vrs, n, kind);
        }
        outputs |= vrs[i] - N_INPUTS < (uint32_t)N_OUTPUTS;
    }
    return outputs && !s->outputs_follow ? slave_refresh(s) : SLAVE_OK;
}

static int slave_may_set(const Slave *s, const Variable *v)
{
    return v->causality != OUTPUT && s->phase <= (v->fixed ? INITIALISING : STEPPING);
}

/* Before variables are set */
static Status slave_write(Slave *s, const uint32_t *vrs, size_t n, int kind)
{
    const Variable *v;
    int all = 1;
    size_t i;
    for (i = 0; i < n; i++) {
        if (vrs[i] >= N_REFERENCES || SLAVE_VARIABLE(vrs[i])->kind != kind) {
            return slave_refuse_references(s, vrs, n, kind);
        }
        all &= slave_may_set(s, SLAVE_VARIABLE(vrs[i]));
    }
    if (all) {
        return SLAVE_OK;
    }
    for (i = 0; slave_may_set(s, SLAVE_VARIABLE(vrs[i])); i++) {
    }
    v = SLAVE_VARIABLE(vrs[i]);
    if (v->causality == OUTPUT) {
        return slave_refuse_variable(s, v->name, ": output set: must be an input or a parameter");
    }
    return slave_refuse_variable(s, v->name,
                                 s->phase == TERMINATED
                                     ? ": set after " SLAVE_FMI "Terminate: must be before"
                                     : ": fixed parameter set in step mode: must be before "
                                       SLAVE_FMI "ExitInitializationMode");
}

static int slave_in_range(uint32_t vr, double value)
{
    const Variable *v = &variables[vr];
    return slave_finite(value) && (!v->limited || (v->low <= value && value <= v->high));
}

static void slave_put_out_of_range(Slave *s, uint32_t vr, double value)
{
    const Variable *v = &variables[vr];
    slave_put(s, v->name);
    slave_put(s, " = ");
    slave_put_value(s, v->kind, value);
    slave_put(s, v->in_unit);
    if (v->limited) {
        slave_put(s, ": must be from ");
        slave_put_general(s, v->low, 6);
        slave_put(s, " to ");
        slave_put_general(s, v->high, 6);
        slave_put(s, v->in_unit);
    } else {
        slave_put(s, ": must be a finite number");
    }
}

static Status slave_refuse_value(Slave *s, uint32_t vr, double value)
{
    slave_begin_text(s);
    slave_put_out_of_range(s, vr, value);
    return slave_refused(s);
}

/* Take a value that was checked; outputs follow when they are next asked for */
static void slave_take(Slave *s, uint32_t vr, double value)
{
    s->values[vr] = value;
    s->params_are_read &= vr < N_INPUTS + N_OUTPUTS;
    s->outputs_follow = 0;
}

/* What functions of FMI that get and set values of a type begin with: `to` and `from` are the i-th
   value, of which the slave has a double */
#define SLAVE_GET(vrs, n, kind, to, type)                                                          \
    size_t i;                                                                                      \
    if (slave_read(s, vrs, n, kind) != SLAVE_OK) {                                                 \
        return SLAVE_ERROR;                                                                        \
    }                                                                                              \
    for (i = 0; i < n; i++) {                                                                      \
        to = (type)s->values[vrs[i]];                                                              \
    }

#define SLAVE_SET(vrs, n, kind, from)                                                              \
    size_t i;                                                                                      \
    if (slave_write(s, vrs, n, kind) != SLAVE_OK) {                                                \
        return SLAVE_ERROR;                                                                        \
    }                                                                                              \
    for (i = 0; i < n; i++) {                                                                      \
        if (!slave_in_range(vrs[i], (double)(from))) {                                             \
            return slave_refuse_value(s, vrs[i], (double)(from));                                  \
        }                                                                                          \
    }                                                                                              \
    for (i = 0; i < n; i++) {                                                                      \
        slave_take(s, vrs[i], (double)(from));                                                     \
    }

/* Steps */

static int slave_clocks_agree(double host, double own)
{
    double apart = fabs(host - own);
    return host == own
           || (slave_finite(host)
               && (apart <= 1e-12 * fabs(host) || apart <= 1e-12 * fabs(own)
                   || apart <= SLAVE_TIME_TOLERANCE));
}

static Status slave_check_step(Slave *s, double time, double h)
{
    if (slave_require(s, "DoStep", STEPPING) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (!(h > 0.0 && slave_finite(h))) {
        slave_begin_text(s);
        slave_put(s, "step size = ");
        slave_put_number(s, h);
        slave_put(s, " s: must be a finite number above 0");
        return slave_refused(s);
    }
    if (!slave_clocks_agree(time, s->values[SLAVE_TIME])) {
        slave_begin_text(s);
        slave_put(s, "step from ");
        slave_put_number(s, time);
        slave_put(s, " s: must be from ");
        slave_put_number(s, s->values[SLAVE_TIME]);
        slave_put(s, " s");
        return slave_refused(s);
    }
    return SLAVE_OK;
}

static void slave_begin_discard(Slave *s, double h)
{
    slave_begin_text(s);
    slave_put(s, "step of ");
    slave_put_number(s, h);
    slave_put(s, " s: ");
}

static Status slave_discarded(Slave *s)
{
    slave_log(s, SLAVE_DISCARD);
    return SLAVE_DISCARD;
}

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

static double slave_substeps(const Slave *s, double h, Fault *fault)
{
    return block_substeps(&s->params, &s->state, &s->inputs, h, fault);
}

/* Discard a step that has too many sub-steps, and say how long it may be */
static Status slave_end_long_step(Slave *s, double h)
{
    double longest = 0.0, too_long = h, middle, substeps, digit = 0.0;
    Fault fault;
    slave_no_fault(&fault);
    for (;;) {
        middle = 0.5 * (longest + too_long);
        if (!(longest < middle && middle < too_long)) {
            break;
        }
        substeps = slave_substeps(s, middle, &fault);
        if (fault.kind != FAULT_NONE) {
            return slave_end_step(s, h, &fault);
        }
        if (substeps <= block_most_substeps) {
            longest = middle;
        } else {
            too_long = middle;
        }
    }
    substeps = slave_substeps(s, h, &fault);
    if (fault.kind != FAULT_NONE) {
        return slave_end_step(s, h, &fault);
    }
    if (longest != 0.0) {
        digit = pow(10.0, floor(log10(longest)) - 2.0);  /* the third */
        if (digit == 0.0) {
            py_fault(&fault, FAULT_ARITHMETIC, "ZeroDivisionError", "float division by zero");
            return slave_end_step(s, h, &fault);
        }
    }
    slave_begin_discard(s, h);
    slave_put(s, "needs ");
    slave_put_general(s, substeps, 3);
    slave_put(s, " sub-steps, more than ");
    slave_put_general(s, block_most_substeps, 6);
    if (longest != 0.0) {
        slave_put(s, "; must be at most ");
        slave_put_general(s, floor(longest / digit * (1.0 + 1e-9)) * digit, 3);
        slave_put(s, " s");
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
    int few;
    if (!(s->phase == STEPPING && 0.0 < h && h <= DBL_MAX && -SLAVE_TIME_TOLERANCE <= apart
          && apart <= SLAVE_TIME_TOLERANCE)
        && slave_check_step(s, time, h) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (!s->outputs_follow) {
        if (!s->params_are_read && slave_read_params(s) != SLAVE_OK) {
            return SLAVE_ERROR;
        }
        block_inputs(s->values, &s->inputs);
    }
    slave_no_fault(&fault);
    few = slave_substeps(s, h, &fault) <= block_most_substeps;  /* one without a bound has none */
    if (fault.kind != FAULT_NONE) {
        return slave_end_step(s, h, &fault);
    }
    if (!few) {
        return slave_end_long_step(s, h);
    }
    block_step(&s->params, &s->state, &s->inputs, h, &after, &fault);
    if (fault.kind == FAULT_NONE) {
        block_outputs(&s->params, &after, &s->inputs, &y, &fault);
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
    s->state = after;
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
    state->state = s->state;
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
    s->state = state->state;
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
