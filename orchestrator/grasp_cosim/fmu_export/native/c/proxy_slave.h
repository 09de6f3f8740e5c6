/* A proxy as a slave: at every step it exchanges its variables with a peer over UDP.

   Before it is included: wire.h, and what slave.h needs but for what is defined here; of the FMU, whose
   variables are in the order inputs, parameters, outputs of the original, settings, holds, failsafes,
   diagnostics
       PROXY_ORIGINAL               the file name of the original
       N_REQUEST, N_ANSWER          its inputs and parameters, its outputs
       REQUEST_SIZE, ANSWER_SIZE    the bytes of their values */
#ifndef PROXY_SLAVE_H
#define PROXY_SLAVE_H

#define SLAVE_HAS_STATES 0
#define SLAVE_LONGEST_STEP WIRE_LONGEST_STEP

#include "channel.h"
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

typedef struct {
    int state, on_loss;
    uint64_t missed, sessions;  /* in a row; begun, when it last answered */
    uint8_t request[REQUEST_SIZE + 1];  /* the values that go to the peer */
    Text loss;                          /* why the peer is lost */
    int is_connected;
    char host[NET_HOST_SIZE], key_file[NET_HOST_SIZE];  /* to what */
    double port;
    Channel channel;
} Model;

#include "slave.h"

static const char *const proxy_on_loss[] = {"hold", "failsafe", "stop"};

/* Messages */

static Text *proxy_put_peer(Slave *s, Text *said)
{
    text_say(said, "%s:%d", slave_string(s, PROXY_HOST), (int)s->values[PROXY_PORT]);
    return said;
}

/* Why the peer refused */
static void proxy_put_refusal(const Channel *c, Text *said)
{
    switch (c->refused) {
    case WIRE_OTHER_INTERFACE:
        text_say(said, "another interface: %s", c->client.reason);
        break;
    case WIRE_OTHER_VERSION:
        text_say(said, "the peer speaks protocol %d: must be %d", c->client.version, WIRE_VERSION);
        break;
    case WIRE_BUSY:
        text_put(said, "the peer is busy with another proxy");
        break;
    case WIRE_UNKNOWN:
        text_put(said, "the peer does not know this session");
        break;
    default:
        text_say(said, "the peer failed: %s", c->client.reason);
    }
}

/* That there was no answer in the time of a setting, and what the network reported */
static void proxy_put_silence(const Slave *s, int timeout, Text *said)
{
    const char *trouble = s->model.channel.trouble;
    text_say(said, " within %g s", s->values[timeout]);
    if (*trouble) {
        text_say(said, " (%s)", trouble);
    }
}

/* Settings */

static int64_t proxy_deadline(const Slave *s, int timeout)
{
    return net_now() + (int64_t)rint(s->values[timeout] * 1e9);
}

static Status proxy_read_settings(Slave *s)
{
    const char *chosen = slave_string(s, PROXY_ON_LOSS);
    int i;
    for (i = HOLD; i <= STOP && !s->params_are_read; i++) {
        if (strcmp(chosen, proxy_on_loss[i]) == 0) {
            s->model.on_loss = i;
            s->params_are_read = 1;
        }
    }
    return s->params_are_read
               ? SLAVE_OK
               : slave_refuse(s, "proxy.on_loss = %s: must be hold, failsafe, stop", chosen);
}

static Status proxy_refuse_key(Slave *s, const char *reason)
{
    return slave_refuse(s, "proxy.key_file = %s: %s", slave_string(s, PROXY_KEY_FILE), reason);
}

/* Begin with the shared key in the file of the settings, or without one */
static Status proxy_read_key(Slave *s)
{
    const char *file = slave_string(s, PROXY_KEY_FILE);
    Client *client = &s->model.channel.client;
    uint8_t data[WIRE_LARGEST_KEY + 1];
    char reason[NET_TEXT_SIZE];
    size_t first, size;
    long n;
    if (!*file) {
        client_begin(client, NULL, 0);
        return SLAVE_OK;
    }
    n = net_read(file, data, sizeof data, reason);
    if (n < 0) {
        return proxy_refuse_key(s, reason);
    }
    if (n > WIRE_LARGEST_KEY) {
        return proxy_refuse_key(s, "file of more than 4096 bytes: is no key");
    }
    size = wire_key(data, (size_t)n, &first);
    if (!client_begin(client, data + first, size)) {
        return slave_refuse(s, "proxy.key_file = %s: key of %d bytes: must have 16 or more", file,
                            (int)size);
    }
    if (net_is_exposed(file)) {
        text_say(slave_say(s), "%s: others have access to this key: must be chmod 600", file);
        slave_log(s, SLAVE_WARNING);
    }
    return SLAVE_OK;
}

/* The peer */

static void proxy_set_state(Slave *s, int state)
{
    s->model.state = state;
    s->values[PROXY_STATE] = state;
}

/* The end of the channel, for the peer as well */
static void slave_end(Slave *s)
{
    if (s->model.is_connected) {
        channel_close(&s->model.channel);
        s->model.is_connected = 0;
        proxy_set_state(s, NOT_CONNECTED);
    }
}

/* Initialisation failed; the host may try again */
static Status proxy_give_up(Slave *s)
{
    Channel *c = &s->model.channel;
    Text *said;
    slave_end(s);
    said = slave_say(s);
    if (c->refused) {
        text_put(proxy_put_peer(s, said), ": ");
        proxy_put_refusal(c, said);
        return slave_refused(s);
    }
    text_put(said, "no answer from ");
    proxy_put_silence(s, PROXY_CONNECT_TIMEOUT, proxy_put_peer(s, said));
    text_say(said, ": is the peer running there, and has it %s key? e.g. grasp-cosim serve %s --port %d",
             *slave_string(s, PROXY_KEY_FILE) ? "the same" : "no", PROXY_ORIGINAL,
             (int)s->values[PROXY_PORT]);
    return slave_refused(s);
}

/* A socket to the peer of the settings, whose name is resolved now */
static Status proxy_open(Slave *s)
{
    Model *m = &s->model;
    char reason[NET_TEXT_SIZE];
    if (proxy_read_key(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    strcpy(m->host, slave_string(s, PROXY_HOST));
    strcpy(m->key_file, slave_string(s, PROXY_KEY_FILE));
    m->port = s->values[PROXY_PORT];
    m->channel.socket = net_open(m->host, (int)m->port, reason);
    if (m->channel.socket == NO_SOCKET) {
        text_say(proxy_put_peer(s, slave_say(s)), ": no connection: %s", reason);
        return slave_refused(s);
    }
    m->channel.stage = CHANNEL_NEW;
    m->channel.sessions = 0;
    m->channel.refused = 0;
    m->channel.trouble[0] = '\0';
    m->is_connected = 1;
    return SLAVE_OK;
}

/* A channel with a session to the peer of the settings */
static Status proxy_connect(Slave *s)
{
    Model *m = &s->model;
    if (proxy_read_settings(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (m->is_connected && m->port == s->values[PROXY_PORT]
        && strcmp(m->host, slave_string(s, PROXY_HOST)) == 0
        && strcmp(m->key_file, slave_string(s, PROXY_KEY_FILE)) == 0) {
        return SLAVE_OK;
    }
    slave_end(s);
    if (proxy_open(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    if (!channel_greet(&m->channel, proxy_deadline(s, PROXY_CONNECT_TIMEOUT))) {
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
    for (i = 0; i < N_REQUEST; i++, at += 8) {
        if (variables[i].kind == KIND_REAL) {
            wire_put_real(at, s->values[i]);
        } else {  /* a Boolean is an Integer of 0 or 1 */
            wire_put_integer(at, (int32_t)s->values[i]);
        }
    }
}

/* The outputs of the newest answer */
static void proxy_take(Slave *s)
{
    const uint8_t *at = s->model.channel.client.outputs;
    int i;
    for (i = PROXY_OUTPUTS; i < PROXY_OUTPUTS + N_ANSWER; i++, at += 8) {
        s->values[i] = variables[i].kind == KIND_REAL ? wire_get_real(at) : wire_get_integer(at);
    }
}

/* The outputs of a lost peer that are not held */
static void proxy_take_failsafe(Slave *s)
{
    int i;
    for (i = 0; i < N_ANSWER; i++) {
        if (s->values[PROXY_HOLDS + i] == 0.0) {
            s->values[PROXY_OUTPUTS + i] = s->values[PROXY_FAILSAFES + i];
        }
    }
}

static double proxy_count(uint64_t count)
{
    return count < INT32_MAX ? (double)count : (double)INT32_MAX;
}

/* Bring the diagnostics up to date; before the first step they would not settle */
static void proxy_report(Slave *s)
{
    const Client *client = &s->model.channel.client;
    double *v = s->values;
    v[PROXY_STATE] = s->model.state;
    v[PROXY_MISSED] = proxy_count(client->counters.missed);
    v[PROXY_CONSECUTIVE_MISSED] = proxy_count(s->model.missed);
    v[PROXY_LATE] = proxy_count(client->counters.late);
    v[PROXY_OUT_OF_ORDER] = proxy_count(client->counters.out_of_order);
    v[PROXY_DUPLICATED] = proxy_count(client->counters.duplicated);
    v[PROXY_REJECTED] = proxy_count(client->counters.rejected);
    v[PROXY_SESSIONS] = proxy_count(s->model.channel.sessions);
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
        if (!channel_initialise(&s->model.channel, s->values[SLAVE_TIME], s->model.request,
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
        text_say(proxy_put_peer(s, slave_say(s)), ": the peer answers again%s",
                 m->channel.sessions > m->sessions ? " in a new session, its model set up anew" : "");
        slave_log(s, SLAVE_WARNING);
    }
    m->sessions = m->channel.sessions;
    m->state = CONNECTED;
    m->missed = 0;
}

static void proxy_lose(Slave *s)
{
    Model *m = &s->model;
    m->state = LOST;
    text_clear(&m->loss);
    text_say(proxy_put_peer(s, &m->loss), " is lost, %d missed in a row: ",
             (int)proxy_count(m->missed));
    if (m->channel.refused) {
        proxy_put_refusal(&m->channel, &m->loss);
    } else {
        text_put(&m->loss, "no answer");
        proxy_put_silence(s, PROXY_TIMEOUT, &m->loss);
    }
    if (m->on_loss == STOP) {
        return;
    }
    text_say(slave_say(s), "%s; proxy.on_loss = %s", m->loss.at, proxy_on_loss[m->on_loss]);
    slave_log(s, SLAVE_WARNING);
    proxy_take(s);
    if (m->on_loss == FAILSAFE) {
        proxy_take_failsafe(s);
    }
}

static void proxy_note_miss(Slave *s)
{
    Model *m = &s->model;
    m->missed++;
    if (m->state == LOST) {
        return;
    }
    m->state = MISSING;
    if (m->channel.refused == WIRE_FAILED
        || (double)m->missed > s->values[PROXY_MISSES_TOLERATED]) {
        proxy_lose(s);
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
        if (channel_step(&m->channel, time, h, m->request, proxy_deadline(s, PROXY_TIMEOUT),
                         m->state == LOST)) {
            proxy_note_answer(s);
        } else {
            proxy_note_miss(s);
        }
    }
    if (m->state == LOST && m->on_loss == STOP) {
        proxy_report(s);
        return slave_refuse(s, "%s", m->loss.at);
    }
    s->values[SLAVE_TIME] = time + h;
    if (m->state != LOST) {
        proxy_take(s);
    }
    proxy_report(s);
    return SLAVE_OK;
}

#endif
