/* A co-simulation slave: life cycle, checks, values, messages. A call that is refused has no effect,
   and leaves one line with its reason in the log of the host.

   It is included by block_slave.h and proxy_slave.h. Before that: what fmi2.h or fmi3.h define at
   their beginning, Host, Status and the words of that FMI; and of the FMU
       N_VARIABLES, variables   in the order of their value references
       N_TEXTS, texts           the Strings: start values, and their places in variables and values
       TOKEN                    the GUID
       Model                    what else an instance has
       SLAVE_LONGEST_STEP       in s
       SLAVE_HAS_STATES         1: they can be saved */
#ifndef SLAVE_H
#define SLAVE_H

#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "variable.h"

enum { INSTANTIATED, INITIALISING, STEPPING, TERMINATED };  /* phases */

#define SLAVE_TIME N_VARIABLES     /* the place of the time, in s, behind the values */
#define SLAVE_TIME_TOLERANCE 1e-9  /* how far the host's clock may be off, in s; or 1e-12 of it */
#define SLAVE_NAME_SIZE 256        /* bytes with the NUL; what is longer is cut off */
#define SLAVE_STRING_SIZE 1024     /* of the value of a String */

typedef struct {
    Host host;
    char name[SLAVE_NAME_SIZE];
    double values[N_VARIABLES + 1];
    char texts[N_TEXTS + 1][SLAVE_STRING_SIZE];
    int phase;
    int params_are_read;  /* 0: one was set, and they are to be read again */
    int outputs_follow;   /* 0: something was set, and the outputs are out of date */
    Model model;
    Text said;            /* the message of now */
} Slave;

static const char *const slave_phases[] = {"before initialisation", "in initialisation mode",
                                           "in step mode", "after " SLAVE_FMI "Terminate"};
static const char *const slave_kinds[] = {SLAVE_REAL, SLAVE_BOOLEAN, SLAVE_INTEGER, "String"};
static const char *const slave_categories[] = {"", "logStatusWarning", "logStatusDiscard",
                                               "logStatusError"};

/* Of the interface */

static void slave_log(const Slave *s, Status status);  /* s->said to the host */
static void *slave_allocate(const Host *host, size_t size);
static void slave_release(const Host *host, void *memory);

/* What a block and a proxy do each in its own way */

static Status slave_start(Slave *s);                 /* be as new */
static Status slave_enter_initialisation(Slave *s);  /* go on to that phase */
static Status slave_refresh(Slave *s);               /* outputs follow what was set */
static void slave_end(Slave *s);                     /* let go of what an instance holds */

/* Messages */

/* A new message: NAME, t = 0.5 s: ... */
static Text *slave_say(Slave *s)
{
    text_clear(&s->said);
    text_put(&s->said, s->name);
    text_put(&s->said, ", t = ");
    text_general(&s->said, s->values[SLAVE_TIME], 9);
    text_put(&s->said, " s: ");
    return &s->said;
}

static Status slave_refused(Slave *s)
{
    slave_log(s, SLAVE_ERROR);
    return SLAVE_ERROR;
}

/* Refuse a call, with its reason as text_say() has it */
TEXT_LIKE_PRINTF static Status slave_refuse(Slave *s, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    text_put_list(slave_say(s), format, list);
    va_end(list);
    return slave_refused(s);
}

/* A message about a step that is not taken, to be completed */
static Text *slave_say_step(Slave *s, double h)
{
    text_say(slave_say(s), "step of %.17g s: ", h);
    return &s->said;
}

static Status slave_discarded(Slave *s)
{
    slave_log(s, SLAVE_DISCARD);
    return SLAVE_DISCARD;
}

/* name = value unit */
static void slave_put_value(Text *said, const Variable *v, double value)
{
    text_say(said, "%s = ", v->name);
    if (v->kind == KIND_REAL) {
        text_number(said, value);
    } else if (v->kind == KIND_INTEGER) {
        text_general(said, value, 17);
    } else {
        text_put(said, value != 0.0 ? "true" : "false");
    }
    text_put(said, v->in_unit);
}

static int slave_finite(double v)
{
    return v - v == 0.0;
}

/* The life cycle */

/* The start values, before initialisation */
static void slave_start_values(Slave *s)
{
    int i;
    for (i = 0; i < N_VARIABLES; i++) {
        s->values[i] = variables[i].start;
    }
    for (i = 0; i < N_TEXTS; i++) {
        strcpy(s->texts[i], texts[i]);
    }
    s->values[SLAVE_TIME] = 0.0;
    s->params_are_read = s->outputs_follow = 0;
    s->phase = INSTANTIATED;
}

/* A new instance, NULL if it is refused; `refusal` is why the interface refuses it, or NULL */
static Slave *slave_new(const Host *host, const char *name, const char *token, const char *refusal)
{
    Slave *s = (Slave *)slave_allocate(host, sizeof *s);
    Status status;
    if (!s) {
        return NULL;
    }
    memset(s, 0, sizeof *s);
    s->host = *host;
    name = name ? name : "";
    memcpy(s->name, name, text_fitting(name, sizeof s->name - 1));
    if (refusal) {
        status = slave_refuse(s, "%s", refusal);
    } else if (!token || strcmp(token, TOKEN) != 0) {
        status = slave_refuse(s, SLAVE_TOKEN " = %s: must be that of this FMU, %s",
                              token ? token : "NULL", TOKEN);
    } else {
        status = slave_start(s);
    }
    if (status != SLAVE_OK) {
        slave_release(host, s);
        return NULL;
    }
    return s;
}

static void slave_free(Slave *s)
{
    Host host = s->host;
    slave_end(s);
    slave_release(&host, s);
}

static Status slave_require(Slave *s, const char *function, int phase)
{
    if (s->phase == phase) {
        return SLAVE_OK;
    }
    return slave_refuse(s, SLAVE_FMI "%s %s: must be %s", function, slave_phases[s->phase],
                        slave_phases[phase]);
}

static Status slave_begin_at(Slave *s, double start)
{
    if (!slave_finite(start)) {
        return slave_refuse(s, "start time = %.17g s: must be a finite number", start);
    }
    s->values[SLAVE_TIME] = start;
    return SLAVE_OK;
}

/* From a phase to the next, if the values set so far go together */
static Status slave_go_on(Slave *s)
{
    Status status = slave_refresh(s);
    s->phase += status == SLAVE_OK;
    return status;
}

static Status slave_enter(Slave *s, double start)
{
    double before = s->values[SLAVE_TIME];
    Status status = slave_require(s, "EnterInitializationMode", INSTANTIATED);
    status = status == SLAVE_OK ? slave_begin_at(s, start) : status;
    status = status == SLAVE_OK ? slave_enter_initialisation(s) : status;
    if (status != SLAVE_OK) {
        s->values[SLAVE_TIME] = before;
    }
    return status;
}

static Status slave_exit(Slave *s)
{
    Status status = slave_require(s, "ExitInitializationMode", INITIALISING);
    return status == SLAVE_OK ? slave_go_on(s) : status;
}

static Status slave_terminate(Slave *s)
{
    slave_end(s);
    s->phase = TERMINATED;
    return SLAVE_OK;
}

static Status slave_reset(Slave *s)
{
    slave_end(s);
    return slave_start(s);
}

/* Values. First all references and values of a call are checked, then they are used. */

static const Variable slave_time = {"time", " s", KIND_REAL, OUTPUT, 0, 0, 0.0, 0.0, 0.0};

static const Variable *slave_variable(uint32_t vr)
{
    return vr < N_VARIABLES ? &variables[vr] : &slave_time;
}

/* Refuse a reference that is out of range, or of another kind */
static Status slave_refuse_reference(Slave *s, uint32_t vr, const char *kind)
{
    const Variable *v = slave_variable(vr);
    if (vr >= N_REFERENCES) {
        return slave_refuse(s, "value reference %d: must be from 0 to %d", (int)vr,
                            N_REFERENCES - 1);
    }
    return slave_refuse(s, "%s: accessed as %s: must be as %s", v->name, kind,
                        slave_kinds[v->kind]);
}

static int slave_is(uint32_t vr, int kind)
{
    return vr < N_REFERENCES && slave_variable(vr)->kind == kind;
}

/* Before variables are read: outputs follow what was set */
static Status slave_read(Slave *s, const uint32_t *vrs, size_t n, int kind)
{
    int outputs = 0;
    size_t i;
    for (i = 0; i < n; i++) {
        if (!slave_is(vrs[i], kind)) {
            return slave_refuse_reference(s, vrs[i], slave_kinds[kind]);
        }
        outputs |= slave_variable(vrs[i])->causality == OUTPUT;
    }
    return outputs && !s->outputs_follow ? slave_refresh(s) : SLAVE_OK;
}

static Status slave_refuse_set(Slave *s, const Variable *v)
{
    return slave_refuse(s, "%s: %s", v->name,
                        v->causality == OUTPUT ? "output set: must be an input or a parameter"
                        : s->phase == TERMINATED
                            ? "set after " SLAVE_FMI "Terminate: must be before"
                            : "fixed parameter set in step mode: must be before " SLAVE_FMI
                              "ExitInitializationMode");
}

/* Before variables are set */
static Status slave_write(Slave *s, const uint32_t *vrs, size_t n, int kind)
{
    size_t i;
    for (i = 0; i < n; i++) {
        const Variable *v;
        if (!slave_is(vrs[i], kind)) {
            return slave_refuse_reference(s, vrs[i], slave_kinds[kind]);
        }
        v = slave_variable(vrs[i]);
        if (v->causality == OUTPUT || s->phase > (v->fixed ? INITIALISING : STEPPING)) {
            return slave_refuse_set(s, v);
        }
    }
    return SLAVE_OK;
}

static int slave_in_range(const Variable *v, double value)
{
    if (v->limited == INFINITE) {
        return value >= -DBL_MAX;
    }
    return slave_finite(value) && (!v->limited || (v->low <= value && value <= v->high));
}

static Status slave_refuse_value(Slave *s, const Variable *v, double value)
{
    Text *said = slave_say(s);
    slave_put_value(said, v, value);
    if (v->limited == LIMITED) {
        text_say(said, ": must be from %g to %g%s", v->low, v->high, v->in_unit);
    } else {
        text_put(said, ": must be a finite number");
        text_put(said, v->limited == INFINITE ? ", or inf" : "");
    }
    return slave_refused(s);
}

/* That a variable was set: outputs follow when they are next asked for */
static void slave_note_set(Slave *s, uint32_t vr)
{
    s->params_are_read &= variables[vr].causality != PARAMETER;
    s->outputs_follow = 0;
}

/* slave_get_Type() and slave_set_Type(): values of a type, of which the slave has doubles */
#define SLAVE_VALUES(Type, kind, type)                                                             \
    static Status slave_get_##Type(Slave *s, const uint32_t *vrs, size_t n, type *values)          \
    {                                                                                              \
        size_t i;                                                                                  \
        if (slave_read(s, vrs, n, kind) != SLAVE_OK) {                                             \
            return SLAVE_ERROR;                                                                    \
        }                                                                                          \
        for (i = 0; i < n; i++) {                                                                  \
            values[i] = (type)s->values[vrs[i]];                                                   \
        }                                                                                          \
        return SLAVE_OK;                                                                           \
    }                                                                                              \
                                                                                                   \
    static Status slave_set_##Type(Slave *s, const uint32_t *vrs, size_t n, const type *values)    \
    {                                                                                              \
        size_t i;                                                                                  \
        if (slave_write(s, vrs, n, kind) != SLAVE_OK) {                                            \
            return SLAVE_ERROR;                                                                    \
        }                                                                                          \
        for (i = 0; kind != KIND_BOOLEAN && i < n; i++) {                                          \
            if (!slave_in_range(&variables[vrs[i]], (double)values[i])) {                          \
                return slave_refuse_value(s, &variables[vrs[i]], (double)values[i]);               \
            }                                                                                      \
        }                                                                                          \
        for (i = 0; i < n; i++) {                                                                  \
            s->values[vrs[i]] = kind == KIND_BOOLEAN ? values[i] != 0 : (double)values[i];         \
            slave_note_set(s, vrs[i]);                                                             \
        }                                                                                          \
        return SLAVE_OK;                                                                           \
    }

static char *slave_string(Slave *s, uint32_t vr)
{
    return s->texts[(int)variables[vr].start];
}

static Status slave_get_String(Slave *s, const uint32_t *vrs, size_t n, const char **values)
{
    size_t i;
    if (slave_read(s, vrs, n, KIND_STRING) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    for (i = 0; i < n; i++) {
        values[i] = slave_string(s, vrs[i]);
    }
    return SLAVE_OK;
}

static Status slave_set_String(Slave *s, const uint32_t *vrs, size_t n, const char *const *values)
{
    size_t i;
    if (slave_write(s, vrs, n, KIND_STRING) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    for (i = 0; i < n; i++) {
        const Variable *v = &variables[vrs[i]];
        if (!values[i] || strlen(values[i]) > (size_t)v->high) {
            return slave_refuse(s, "%s%s: must have 0 to %g bytes", v->name,
                                values[i] ? ": too long" : " = NULL", v->high);
        }
    }
    for (i = 0; i < n; i++) {
        memmove(slave_string(s, vrs[i]), values[i], strlen(values[i]) + 1);  /* or that very one */
        slave_note_set(s, vrs[i]);
    }
    return SLAVE_OK;
}

/* Steps */

/* That a step can be taken: where the last one ended, and not too long */
static Status slave_check_step(Slave *s, double time, double h)
{
    double own = s->values[SLAVE_TIME], apart = fabs(time - own);
    if (slave_require(s, "DoStep", STEPPING) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (!(0.0 < h && h <= DBL_MAX)) {
        return slave_refuse(s, "step size = %.17g s: must be a finite number above 0", h);
    }
    if (!(apart <= SLAVE_TIME_TOLERANCE || apart <= 1e-12 * fabs(own))) {
        return slave_refuse(s, "step from %.17g s: must be from %.17g s", time, own);
    }
    if (h > SLAVE_LONGEST_STEP) {
        text_say(slave_say_step(s, h), "must be at most %g s", SLAVE_LONGEST_STEP);
        return slave_discarded(s);
    }
    return SLAVE_OK;
}

#endif
