/* A proxy as a slave: at every step it exchanges its variables with a peer over UDP. It does what
   proxy.py does.

   Before it is included: wire.h, and what slave.h needs, but for Model; of the FMU, whose variables
   are in the order inputs, parameters, outputs of the original, settings, holds, failsafes, diagnostics
       PROXY_ORIGINAL               the file name of the original
       N_REQUEST, N_ANSWER          its inputs and parameters, its outputs
       REQUEST_SIZE, ANSWER_SIZE    the bytes of their values */
#ifndef PROXY_SLAVE_H
#define PROXY_SLAVE_H

#define SLAVE_HAS_STATES 0
#define SLAVE_LONGEST_STEP WIRE_LONGEST_STEP
#define CLIENT_KIND(i) variables[i].kind

#include "connection.h"
#include "variable.h"

enum { NOT_CONNECTED, CONNECTED, MISSING, LOST };  /* proxy.state */
enum { HOLD, FAILSAFE, STOP };                     /* proxy.on_loss */

/* The places of the proxy's own variables */
enum {
    PROXY_OUTPUTS = N_REQUEST,
    PROXY_HOST = PROXY_OUTPUTS + N_ANSWER,
    PROXY_PORT,
    PROXY_TIMEOUT,
    PROXY_CONNECT_TIMEOUT,
    PROXY_MISSES_TOLERATED,
    PROXY_ON_LOSS,
    PROXY_RESUME,
    PROXY_KEY_FILE,
    PROXY_HOLDS,
    PROXY_FAILSAFES = PROXY_HOLDS + N_ANSWER,
    PROXY_STATE = PROXY_FAILSAFES + N_ANSWER,
    PROXY_MISSED,
    PROXY_CONSECUTIVE_MISSED,
    PROXY_LATE,
    PROXY_OUT_OF_ORDER,
    PROXY_DUPLICATED,
    PROXY_REJECTED,
    PROXY_SESSIONS,
    PROXY_ROUND_TRIP_TIME,
    PROXY_AGE
};

#define PROXY_MOST 2147483647.0

typedef struct {
    int state, on_loss;
    uint64_t missed, sessions;  /* in a row; begun, when it last answered */
    uint8_t request[REQUEST_SIZE + 1];  /* the values that go to the peer */
    Text loss;  /* why the peer is lost */
    int is_connected;
    char host[NET_HOST_SIZE], key_file[NET_HOST_SIZE];  /* to what */
    double port;
    Connection connection;
} Model;

#include "slave.h"

static const char *const proxy_on_loss[] = {"hold", "failsafe", "stop"};

/* Texts */

static void slave_put(Slave *s, const char *text)
{
    text_put(&s->said, text);
}

static void slave_put_part(Slave *s, const char *from, const char *to)
{
    text_put_part(&s->said, from, (size_t)(to - from));
}

static void slave_put_quoted(Slave *s, const char *text)
{
    slave_put(s, "'");
    slave_put(s, text);
    slave_put(s, "'");
}

static void slave_put_general(Slave *s, double v, int digits)
{
    text_general(&s->said, v, digits);
}

static void proxy_put_peer(Slave *s)
{
    slave_put(s, slave_string(s, PROXY_HOST));
    slave_put(s, ":");
    slave_put_general(s, s->values[PROXY_PORT], 17);
}

static void proxy_put_trouble(Slave *s)
{
    const char *trouble = s->model.connection.trouble;
    if (trouble[0]) {
        slave_put(s, " (");
        slave_put(s, trouble);
        slave_put(s, ")");
    }
}

static Status proxy_warned(Slave *s)
{
    slave_log(s, SLAVE_WARNING);
    return SLAVE_OK;
}

/* Bytes of the white space that begins there, in the sense of Python; 0: there is none */
static size_t proxy_space(const char *text)
{
    static const char *const wide[] = {"\xc2\x85", "\xc2\xa0", "\xe1\x9a\x80", "\xe2\x80\xa8",
                                       "\xe2\x80\xa9", "\xe2\x80\xaf", "\xe2\x81\x9f",
                                       "\xe3\x80\x80"};
    unsigned char last;
    size_t i;
    if (*text == ' ' || (*text >= '\t' && *text <= '\r') || (*text >= '\x1c' && *text <= '\x1f')) {
        return 1;
    }
    for (i = 0; i < sizeof wide / sizeof *wide; i++) {
        if (strncmp(text, wide[i], strlen(wide[i])) == 0) {
            return strlen(wide[i]);
        }
    }
    last = strncmp(text, "\xe2\x80", 2) == 0 ? (unsigned char)text[2] : 0;
    return last >= 0x80 && last <= 0x8a ? 3 : 0;
}

/* The words of a text with one space between them, as " ".join(text.split()) */
static void proxy_put_words(Slave *s, const char *at)
{
    const char *separator = "";
    while (*at) {
        const char *from;
        while (proxy_space(at)) {
            at += proxy_space(at);
        }
        for (from = at; *at && !proxy_space(at); at++) {
        }
        if (at > from) {
            slave_put(s, separator);
            slave_put_part(s, from, at);
            separator = " ";
        }
    }
}

/* Signatures, line by line: causality, kind, unit and name, with tabs between */

typedef struct {
    const char *begin, *name, *end;
} ProxyLine;

/* The line at `at`, which is moved to the next; 0 where there is none */
static int proxy_line(const char **at, ProxyLine *line)
{
    const char *from = *at, *end = strchr(from, '\n');
    if (!*from) {
        return 0;
    }
    line->begin = line->name = from;
    line->end = end ? end : from + strlen(from);
    for (; from < line->end; from++) {
        if (*from == '\t') {
            line->name = from + 1;
        }
    }
    *at = end ? end + 1 : line->end;
    return 1;
}

static int proxy_same(const char *a, const char *a_end, const char *b, const char *b_end)
{
    return a_end - a == b_end - b && memcmp(a, b, (size_t)(a_end - a)) == 0;
}

/* The line in a text with the name of this one */
static int proxy_find(const char *text, const ProxyLine *wanted, ProxyLine *found)
{
    while (proxy_line(&text, found)) {
        if (proxy_same(found->name, found->end, wanted->name, wanted->end)) {
            return 1;
        }
    }
    return 0;
}

/* A line in words: output gap[1], Real in m */
static void proxy_put_line(Slave *s, const ProxyLine *line)
{
    const char *field[4], *end[4], *at = line->begin;
    int i;
    for (i = 0; i < 4; i++) {
        field[i] = at;
        while (at < line->end && (i == 3 || *at != '\t')) {
            at++;
        }
        end[i] = at;
        at += at < line->end;
    }
    slave_put_part(s, field[0], end[0]);
    slave_put(s, " ");
    slave_put_part(s, field[3], end[3]);
    slave_put(s, ", ");
    slave_put_part(s, field[1], end[1]);
    if (end[2] - field[2] != 1 || *field[2] != '-') {
        slave_put(s, " in ");
        slave_put_part(s, field[2], end[2]);
    }
}

/* One more difference: only the first four are named */
static int proxy_begin_difference(Slave *s, int *count, const char *text)
{
    ++*count;
    if (*count > 4) {
        return 0;
    }
    slave_put(s, *count > 1 ? "; " : "");
    slave_put(s, text);
    return 1;
}

/* How another signature differs from this one, both ended by a NUL */
static void proxy_put_difference(Slave *s, const char *ours, const char *theirs)
{
    ProxyLine line, other;
    const char *at;
    int count = 0;
    for (at = ours; proxy_line(&at, &line);) {
        if (!proxy_find(theirs, &line, &other)
            && proxy_begin_difference(s, &count, "there is no ")) {
            proxy_put_line(s, &line);
        }
    }
    for (at = theirs; proxy_line(&at, &line);) {
        if (!proxy_find(ours, &line, &other)
            && proxy_begin_difference(s, &count, "there is also ")) {
            proxy_put_line(s, &line);
        }
    }
    for (at = ours; proxy_line(&at, &line);) {
        if (proxy_find(theirs, &line, &other)
            && !proxy_same(line.begin, line.end, other.begin, other.end)
            && proxy_begin_difference(s, &count, "")) {
            proxy_put_line(s, &other);
            slave_put(s, ", must be ");
            proxy_put_line(s, &line);
        }
    }
    if (count > 4) {
        slave_put(s, "; and ");
        slave_put_general(s, count - 4, 17);
        slave_put(s, " more");
    }
    if (count == 0) {
        slave_put(s, strcmp(ours, theirs) ? "the variables are in another order" : "unnamed");
    }
}

/* Why the peer refused */
static void proxy_put_refusal(Slave *s)
{
    Connection *c = &s->model.connection;
    const char *reason = (const char *)c->client.reason;
    switch (c->refused) {
    case WIRE_OTHER_INTERFACE:
        slave_put(s, "the peer has another interface: ");
        if (c->client.cut) {
            slave_put(s, "unnamed");
            break;
        }
        wire_signature(c->datagram);  /* nothing else is in it between two calls */
        c->datagram[WIRE_SIGNATURE_SIZE] = '\0';
        proxy_put_difference(s, (const char *)c->datagram, reason);
        break;
    case WIRE_BUSY:
        slave_put(s, "the peer is busy with another proxy");
        break;
    case WIRE_UNKNOWN:
        slave_put(s, "the peer does not know this session");
        break;
    default:
        slave_put(s, "the peer failed: ");
        proxy_put_words(s, reason);
    }
}

/* Settings */

static int64_t proxy_deadline(const Slave *s, int timeout)
{
    double ns = rint(s->values[timeout] * 1e9);
    return net_now() + (int64_t)ns;
}

static Status proxy_read_settings(Slave *s)
{
    const char *chosen = slave_string(s, PROXY_ON_LOSS);
    int i;
    if (s->params_are_read) {
        return SLAVE_OK;
    }
    for (i = HOLD; i <= STOP; i++) {
        if (strcmp(chosen, proxy_on_loss[i]) == 0) {
            s->model.on_loss = i;
            s->params_are_read = 1;
            return SLAVE_OK;
        }
    }
    slave_say(s);
    slave_put(s, "proxy.on_loss = ");
    slave_put_quoted(s, chosen);
    slave_put(s, ": must be hold, failsafe, stop");
    return slave_refused(s);
}

static Status proxy_refuse_key(Slave *s, const char *reason)
{
    slave_say(s);
    slave_put(s, "proxy.key_file = ");
    slave_put_quoted(s, slave_string(s, PROXY_KEY_FILE));
    slave_put(s, ": ");
    slave_put(s, reason);
    return slave_refused(s);
}

static Status proxy_warn_of_rights(Slave *s, const char *file, unsigned mode)
{
    char digits[] = "0000";
    int i;
    for (i = 3; i >= 0; i--, mode >>= 3) {
        digits[i] = (char)('0' + (mode & 7));
    }
    slave_say(s);
    slave_put(s, file);
    slave_put(s, ": others have access to this key, mode ");
    slave_put(s, digits[0] == '0' ? digits + 1 : digits);
    slave_put(s, "; must be 600: chmod 600 ");
    slave_put(s, file);
    return proxy_warned(s);
}

/* Begin with the shared key in the file of the settings, or without one */
static Status proxy_read_key(Slave *s)
{
    const char *file = slave_string(s, PROXY_KEY_FILE);
    Client *client = &s->model.connection.client;
    uint8_t data[WIRE_LARGEST_KEY + 1];
    char text[NET_TEXT_SIZE];
    Text few;
    size_t first, size;
    long n;
    if (!*file) {
        client_begin(client, NULL, 0);
        return SLAVE_OK;
    }
    n = net_read(file, data, sizeof data, text);
    if (n < 0) {
        return proxy_refuse_key(s, text);
    }
    if (n > WIRE_LARGEST_KEY) {
        return proxy_refuse_key(s, "file of more than 4096 bytes: is no key");
    }
    size = wire_key(data, (size_t)n, &first);
    if (!client_begin(client, data + first, size)) {
        text_clear(&few);
        text_put(&few, "key of ");
        text_general(&few, (double)size, 17);
        text_put(&few, " bytes: must have 16 or more");
        return proxy_refuse_key(s, few.at);
    }
    return net_exposed(file) ? proxy_warn_of_rights(s, file, net_exposed(file)) : SLAVE_OK;
}

/* The peer */

static void proxy_set_state(Slave *s, int state)
{
    s->model.state = state;
    s->values[PROXY_STATE] = state;
}

/* The end of the connection, for the peer as well */
static void slave_end(Slave *s)
{
    if (s->model.is_connected) {
        connection_close(&s->model.connection);
        s->model.is_connected = 0;
        proxy_set_state(s, NOT_CONNECTED);
    }
}

/* Initialisation failed; the host may try again */
static Status proxy_give_up(Slave *s)
{
    Connection *c = &s->model.connection;
    slave_end(s);
    slave_say(s);
    if (c->refused) {
        proxy_put_peer(s);
        slave_put(s, ": ");
        proxy_put_refusal(s);
        return slave_refused(s);
    }
    slave_put(s, "no answer from ");
    proxy_put_peer(s);
    slave_put(s, " within ");
    slave_put_general(s, s->values[PROXY_CONNECT_TIMEOUT], 6);
    slave_put(s, " s");
    proxy_put_trouble(s);
    slave_put(s, ": is the peer running there, and has it ");
    slave_put(s, *slave_string(s, PROXY_KEY_FILE) ? "the same" : "no");
    slave_put(s, " key? e.g. grasp-cosim serve " PROXY_ORIGINAL " --port ");
    slave_put_general(s, s->values[PROXY_PORT], 17);
    return slave_refused(s);
}

static Status proxy_refuse_connection(Slave *s, const char *reason)
{
    slave_say(s);
    proxy_put_peer(s);
    slave_put(s, ": no connection: ");
    slave_put(s, reason);
    return slave_refused(s);
}

/* A socket to the peer of the settings */
static Status proxy_open(Slave *s, int64_t deadline)
{
    Model *m = &s->model;
    char text[NET_TEXT_SIZE];
    if (proxy_read_key(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    strcpy(m->host, slave_string(s, PROXY_HOST));
    strcpy(m->key_file, slave_string(s, PROXY_KEY_FILE));
    m->port = s->values[PROXY_PORT];
    m->connection.socket = net_open(m->host, (int)m->port, deadline, text);
    if (m->connection.socket == NO_SOCKET) {
        return proxy_refuse_connection(s, text);
    }
    m->connection.stage = CONNECTION_NEW;
    m->connection.sessions = 0;
    m->connection.refused = 0;
    m->connection.trouble[0] = '\0';
    m->is_connected = 1;
    return SLAVE_OK;
}

/* A connection with a session to the peer of the settings */
static Status proxy_connect(Slave *s)
{
    Model *m = &s->model;
    int64_t deadline;
    if (proxy_read_settings(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (m->is_connected && m->port == s->values[PROXY_PORT]
        && strcmp(m->host, slave_string(s, PROXY_HOST)) == 0
        && strcmp(m->key_file, slave_string(s, PROXY_KEY_FILE)) == 0) {
        return SLAVE_OK;
    }
    slave_end(s);
    deadline = proxy_deadline(s, PROXY_CONNECT_TIMEOUT);
    if (proxy_open(s, deadline) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (!connection_greet(&m->connection, deadline)) {
        return proxy_give_up(s);
    }
    proxy_set_state(s, CONNECTED);
    return SLAVE_OK;
}

/* Values */

static void proxy_pack(Slave *s)
{
    uint8_t *at = s->model.request;
    int i;
    for (i = 0; i < N_REQUEST; i++) {
        switch (variables[i].kind) {
        case KIND_REAL:
            wire_put_real(at, s->values[i]);
            break;
        case KIND_BOOLEAN:
            wire_put_boolean(at, s->values[i] != 0.0);
            break;
        case KIND_INTEGER:
            wire_put_integer(at, (int32_t)s->values[i]);
            break;
        default:
            wire_put_string(at, slave_string(s, (uint32_t)i));
        }
        at += client_value_size(variables[i].kind);
    }
}

/* The outputs of the newest answer */
static void proxy_take(Slave *s)
{
    const uint8_t *at = s->model.connection.client.outputs;
    int i;
    for (i = PROXY_OUTPUTS; i < PROXY_OUTPUTS + N_ANSWER; i++) {
        switch (variables[i].kind) {
        case KIND_REAL:
            s->values[i] = wire_get_real(at);
            break;
        case KIND_BOOLEAN:
            s->values[i] = wire_get_boolean(at);
            break;
        case KIND_INTEGER:
            s->values[i] = wire_get_integer(at);
            break;
        default:
            wire_get_string(at, s->texts[(int)s->values[i]]);
        }
        at += client_value_size(variables[i].kind);
    }
}

/* The outputs of a lost peer that are not held */
static void proxy_take_failsafe(Slave *s)
{
    int i;
    for (i = 0; i < N_ANSWER; i++) {
        int output = PROXY_OUTPUTS + i, safe = PROXY_FAILSAFES + i;
        if (s->values[PROXY_HOLDS + i] != 0.0) {
            continue;
        }
        if (variables[output].kind == KIND_STRING) {
            memmove(slave_string(s, (uint32_t)output), slave_string(s, (uint32_t)safe),
                    SLAVE_STRING_SIZE);
        } else {
            s->values[output] = s->values[safe];
        }
    }
}

static double proxy_count(uint64_t count)
{
    return (double)count < PROXY_MOST ? (double)count : PROXY_MOST;
}

/* Bring the diagnostics up to date; before the first step they would not settle */
static void proxy_report(Slave *s)
{
    const Client *client = &s->model.connection.client;
    const ClientCounters *counters = &client->counters;
    double *v = s->values;
    v[PROXY_STATE] = s->model.state;
    v[PROXY_MISSED] = proxy_count(counters->missed);
    v[PROXY_CONSECUTIVE_MISSED] = proxy_count(s->model.missed);
    v[PROXY_LATE] = proxy_count(counters->late);
    v[PROXY_OUT_OF_ORDER] = proxy_count(counters->out_of_order);
    v[PROXY_DUPLICATED] = proxy_count(counters->duplicated);
    v[PROXY_REJECTED] = proxy_count(counters->rejected);
    v[PROXY_SESSIONS] = proxy_count(s->model.connection.sessions);
    v[PROXY_ROUND_TRIP_TIME] = (double)client->round_trip / 1e9;
    v[PROXY_AGE] = v[SLAVE_TIME] - client->outputs_time;
}

/* In initialisation mode exchange values; after that outputs do not follow a set */
static Status slave_refresh(Slave *s)
{
    if (s->phase != INITIALISING && s->phase != STEPPING) {
        return SLAVE_OK;
    }
    if (s->phase == INITIALISING && proxy_connect(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    proxy_pack(s);
    if (s->phase == INITIALISING) {
        if (!connection_initialise(&s->model.connection, s->values[SLAVE_TIME], s->model.request,
                                   proxy_deadline(s, PROXY_CONNECT_TIMEOUT))) {
            return proxy_give_up(s);
        }
        proxy_take(s);
    }
    s->outputs_follow = 1;
    return SLAVE_OK;
}

/* The life cycle */

static Status slave_start(Slave *s)
{
    slave_start_values(s);
    s->model.state = NOT_CONNECTED;
    s->model.missed = 0;
    s->model.sessions = 1;
    s->model.is_connected = 0;
    return SLAVE_OK;
}

/* Greet the peer */
static Status slave_enter_initialisation(Slave *s)
{
    Status status = proxy_connect(s);
    s->phase += status == SLAVE_OK;
    return status;
}

/* Steps */

static void proxy_note_answer(Slave *s)
{
    Model *m = &s->model;
    if (m->state == LOST) {
        slave_say(s);
        proxy_put_peer(s);
        slave_put(s, ": the peer answers again");
        slave_put(s, m->connection.sessions > m->sessions
                         ? " in a new session, its model set up anew" : "");
        proxy_warned(s);
    }
    m->sessions = m->connection.sessions;
    m->state = CONNECTED;
    m->missed = 0;
}

/* Keep why the peer is lost */
static void proxy_note_loss(Slave *s)
{
    Model *m = &s->model;
    text_clear(&s->said);
    proxy_put_peer(s);
    slave_put(s, " is lost, ");
    slave_put_general(s, (double)m->missed, 17);
    slave_put(s, " missed in a row: ");
    if (m->connection.refused) {
        proxy_put_refusal(s);
    } else {
        slave_put(s, "no answer within ");
        slave_put_general(s, s->values[PROXY_TIMEOUT], 6);
        slave_put(s, " s");
        proxy_put_trouble(s);
    }
    m->loss = s->said;
}

/* A text with that, to which more may be put */
static void proxy_begin_loss(Slave *s)
{
    slave_say(s);
    slave_put(s, s->model.loss.at);
}

static void proxy_lose(Slave *s)
{
    Model *m = &s->model;
    m->state = LOST;
    proxy_note_loss(s);
    if (m->on_loss == STOP) {
        return;
    }
    proxy_begin_loss(s);
    slave_put(s, "; proxy.on_loss = ");
    slave_put(s, proxy_on_loss[m->on_loss]);
    proxy_warned(s);
    proxy_take(s);
    if (m->on_loss == FAILSAFE) {
        proxy_take_failsafe(s);
    }
}

static void proxy_note_miss(Slave *s)
{
    Model *m = &s->model;
    m->missed++;
    if (m->state != LOST) {
        m->state = MISSING;
        if (m->connection.refused == WIRE_FAILED
            || (double)m->missed > s->values[PROXY_MISSES_TOLERATED]) {
            proxy_lose(s);
        }
    }
}

/* Send inputs and parameters, wait for the outputs; without them, hold or lose */
static Status slave_do_step(Slave *s, double time, double h)
{
    Model *m = &s->model;
    Status status = slave_check_step(s, time, h);
    if (status != SLAVE_OK) {
        return status;
    }
    if (!s->outputs_follow && slave_refresh(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (m->state != LOST || s->values[PROXY_RESUME] != 0.0) {
        if (connection_step(&m->connection, time, h, m->request,
                            proxy_deadline(s, PROXY_TIMEOUT), m->state == LOST)) {
            proxy_note_answer(s);
        } else {
            proxy_note_miss(s);
        }
    }
    if (m->state == LOST && m->on_loss == STOP) {
        proxy_report(s);
        proxy_begin_loss(s);
        return slave_refused(s);
    }
    s->values[SLAVE_TIME] = time + h;
    if (m->state != LOST) {
        proxy_take(s);
    }
    proxy_report(s);
    return SLAVE_OK;
}

#endif
