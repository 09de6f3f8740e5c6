/* A co-simulation slave: life cycle, checks, texts, values. It does, call by call, what the Python
   slave of the same FMU does, to the byte; a call that is refused has no effect.

   It is included by what makes a slave of a block, block_slave.h, or of a proxy, proxy_slave.h. Before
   that: the types Host, what an instance knows of its host, and Status, that of FMI; and
       SLAVE_OK, _WARNING, _DISCARD, _ERROR     of Status
       SLAVE_FMI            "fmi2" or "fmi3", for the names of functions in texts
       SLAVE_PER_CENT       how the host's logger wants a % in a text
       SLAVE_REAL, _BOOLEAN, _INTEGER   what this FMI calls the kinds of variables
       SLAVE_TOKEN          and the GUID
       N_REFERENCES         N_VARIABLES, or one more, the time
       TOKEN                the GUID
   and of the FMU: N_VARIABLES, the table variables; N_TEXTS, the table texts with the start values of
   the Strings, of which values and starts are places in it; and Model, what else an instance has.
   The interface defines slave_log(), which gives the message s->text to the host. */
#ifndef SLAVE_H
#define SLAVE_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "number_text.h"

enum { INSTANTIATED, INITIALISING, STEPPING, TERMINATED };     /* phases */

#define SLAVE_TIME N_VARIABLES  /* the place of the time, in s, behind the values */
#define SLAVE_TIME_TOLERANCE 1e-9  /* how far the host's clock may be off, in s; or 1e-12 of it */
#define SLAVE_LARGEST_SHOWN 1024  /* bytes of a text in a message */

typedef struct {
    Host host;
    const char *name;     /* as the host gave it */
    double values[N_VARIABLES + 1];
    char *texts[N_TEXTS + 1];
    int phase;
    int params_are_read;  /* 0: one was set, and they are to be read again */
    int outputs_follow;   /* 0: something was set, and the outputs are out of date */
    Model model;
    char *text, *text_at, *text_end;  /* a message: its begin, its end, that of its memory */
} Slave;

static const char *const slave_phases[] = {"before initialisation", "in initialisation mode",
                                           "in step mode", "after " SLAVE_FMI "Terminate"};
static const char *const slave_kinds[] = {SLAVE_REAL, SLAVE_BOOLEAN, SLAVE_INTEGER, "String"};

static void slave_log(const Slave *s, Status status);

/* What a block and a proxy do each in its own way */

static Status slave_start(Slave *s);    /* as new */
static Status slave_refresh(Slave *s);  /* outputs follow what was set */

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

/* The bytes of the character that begins there, or of what is none; `is_one` says which */
static size_t slave_character(const char *text, int *is_one)
{
    const unsigned char *at = (const unsigned char *)text;
    unsigned char first = at[0], low = 0x80, high = 0xbf;
    size_t i = 1;
    size_t n = first < 0x80 ? 1 : first < 0xc2 ? 0 : first < 0xe0 ? 2 : first < 0xf0 ? 3
               : first < 0xf5 ? 4 : 0;
    low = first == 0xe0 ? 0xa0 : first == 0xf0 ? 0x90 : low;
    high = first == 0xed ? 0x9f : first == 0xf4 ? 0x8f : high;
    while (i < n && at[i] >= (i == 1 ? low : 0x80) && at[i] <= (i == 1 ? high : 0xbf)) {
        i++;
    }
    *is_one = i == n;
    return i;
}

/* Bytes that may be no UTF-8, with U+FFFD for what is none, as bytes.decode(errors="replace") */
static void slave_put_part(Slave *s, const char *from, const char *to)
{
    char character[5];
    while (from < to) {
        int is_one;
        size_t n = slave_character(from, &is_one);
        memcpy(character, from, n);
        character[n] = '\0';
        slave_put(s, is_one ? character : "\xef\xbf\xbd");
        from += n;
    }
}

static void slave_put_decoded(Slave *s, const char *text)
{
    slave_put_part(s, text, text + strlen(text));
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

/* A character of a quoted text; of those beyond ASCII U+0080 to U+00A0 and U+00AD are not shown */
static void slave_put_shown(Slave *s, const char *character, size_t n, char quote)
{
    static const char digits[] = "0123456789abcdef";
    unsigned char first = (unsigned char)character[0], c = first;
    char text[5] = "\\";
    if (n == 2 && first == 0xc2) {
        c = (unsigned char)character[1];
    }
    if (first == '\\' || first == (unsigned char)quote) {
        text[1] = character[0];
    } else if (first == '\t' || first == '\n' || first == '\r') {
        text[1] = first == '\t' ? 't' : first == '\n' ? 'n' : 'r';
    } else if (n == 1 ? c < 0x20 || c == 0x7f : first == 0xc2 && (c <= 0xa0 || c == 0xad)) {
        text[1] = 'x';
        text[2] = digits[c >> 4];
        text[3] = digits[c & 15];
    } else {
        memcpy(text, character, n);
        text[n] = '\0';
    }
    slave_put(s, text);
}

/* As repr() of a text; what is very long is cut */
static void slave_put_quoted(Slave *s, const char *text)
{
    char quote[2] = "'";
    const char *end = text + SLAVE_LARGEST_SHOWN;
    quote[0] = text[strcspn(text, "'")] && !text[strcspn(text, "\"")] ? '"' : '\'';
    slave_put(s, quote);
    while (*text && text < end) {
        int is_one;
        size_t n = slave_character(text, &is_one);
        slave_put_shown(s, is_one ? text : "?", is_one ? n : 1, quote[0]);
        text += n;
    }
    slave_put(s, *text ? "..." : "");
    slave_put(s, quote);
}

static void slave_begin_text(Slave *s)
{
    s->text_at = s->text;
    slave_put_decoded(s, s->name);
    slave_put(s, ", t = ");
    slave_put_general(s, s->values[SLAVE_TIME], 9);
    slave_put(s, " s: ");
}

/* End a call with the text that was begun; the outputs may not have been worked out */
static Status slave_refused(Slave *s)
{
    s->outputs_follow = 0;
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

/* Bytes of memory for the values of Strings, each with its NUL */
static size_t slave_texts_size(void)
{
    size_t size = 0;
    int i;
    for (i = 0; i < N_VARIABLES; i++) {
        size += variables[i].kind == KIND_STRING ? (size_t)variables[i].high + 1 : 0;
    }
    return size;
}

/* Bytes of memory for an instance and its texts */
static size_t slave_size(const char *name)
{
    size_t text = 16384 + 3 * strlen(name);  /* three for a byte that is no UTF-8 */
    int i;
    for (i = 0; i < N_VARIABLES; i++) {
        if (variables[i].causality == OUTPUT) {
            text += strlen(variables[i].name) + strlen(variables[i].in_unit) + 16;
        }
    }
    return sizeof(Slave) + strlen(name) + 1 + slave_texts_size()
           + text * (sizeof SLAVE_PER_CENT - 1);
}

/* Make an instance in memory of slave_size(); what the host calls itself and its FMU is checked */
static Status slave_instantiate(Slave *s, const Host *host, const char *name, const char *token)
{
    char *at = (char *)(s + 1);
    size_t size = slave_size(name);
    int i, n = 0;
    memset(s, 0, size);
    s->host = *host;
    s->name = strcpy(at, name);
    at += strlen(name) + 1;
    for (i = 0; i < N_VARIABLES; i++) {
        if (variables[i].kind == KIND_STRING) {
            s->texts[n++] = at;
            at += (size_t)variables[i].high + 1;
        }
    }
    s->text = at;
    s->text_end = (char *)s + size;
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
        outputs |= vrs[i] < N_VARIABLES && variables[vrs[i]].causality == OUTPUT;
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
    s->params_are_read &= variables[vr].causality != PARAMETER;
    s->outputs_follow = 0;
}

static const char *slave_string(const Slave *s, uint32_t vr)
{
    return s->texts[(int)s->values[vr]];
}

static int slave_is_utf8(const char *text)
{
    int is_one = 1;
    while (is_one && *text) {
        text += slave_character(text, &is_one);
    }
    return is_one;
}

static Status slave_check_string(Slave *s, uint32_t vr, const char *text)
{
    const Variable *v = &variables[vr];
    size_t most = (size_t)v->high;
    if (text && strlen(text) <= most && slave_is_utf8(text)) {
        return SLAVE_OK;
    }
    slave_begin_text(s);
    slave_put(s, v->name);
    slave_put(s, " = ");
    if (!text) {
        slave_put(s, "NULL");
    } else {
        slave_put_quoted(s, text);
    }
    slave_put(s, ": must have 0 to ");
    slave_put_general(s, v->high, 6);
    slave_put(s, " bytes in UTF-8");
    return slave_refused(s);
}

static void slave_take_string(Slave *s, uint32_t vr, const char *text)
{
    memmove(s->texts[(int)s->values[vr]], text, strlen(text) + 1);  /* it may be that very one */
    s->params_are_read &= variables[vr].causality != PARAMETER;
    s->outputs_follow = 0;
}

static Status slave_get_strings(Slave *s, const uint32_t *vrs, size_t n, const char **values)
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

static Status slave_set_strings(Slave *s, const uint32_t *vrs, size_t n, const char *const *values)
{
    size_t i;
    if (slave_write(s, vrs, n, KIND_STRING) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    for (i = 0; i < n; i++) {
        if (slave_check_string(s, vrs[i], values[i]) != SLAVE_OK) {
            return SLAVE_ERROR;
        }
    }
    for (i = 0; i < n; i++) {
        slave_take_string(s, vrs[i], values[i]);
    }
    return SLAVE_OK;
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


#endif
