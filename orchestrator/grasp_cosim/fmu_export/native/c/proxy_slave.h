/* A proxy as a slave: at every step it exchanges its variables with a peer over UDP.

   Before it is included: wire.h, and what slave.h needs but for what is defined here; of the FMU, whose
   variables are in the order inputs, parameters, outputs of the original, settings, holds, failsafes,
   limits of its Real inputs (lowest, highest, rate), those of its Real outputs, diagnostics
       PROXY_ORIGINAL               the file name of the original
       N_REQUEST, N_ANSWER          its inputs and parameters, its outputs
       REQUEST_SIZE, ANSWER_SIZE    the bytes of their values
       N_SENT, sent_reals           its Real inputs: their number and places
       N_MEASURED, measured_reals   its Real outputs */
#ifndef PROXY_SLAVE_H
#define PROXY_SLAVE_H

#define SLAVE_HAS_STATES 0
#define SLAVE_LONGEST_STEP WIRE_LONGEST_STEP

#include "channel.h"
#include "variable.h"

enum { NOT_CONNECTED, CONNECTED, MISSING, LOST, BACK };  /* proxy.state */
enum { HOLD, FAILSAFE, STOP };                           /* proxy.on_loss */
enum { CLAMP, TRIP };                                    /* proxy.on_limit */

/* The places of the proxy's own variables */
enum {
    PROXY_OUTPUTS = N_REQUEST,
    PROXY_HOST = PROXY_OUTPUTS + N_ANSWER,
    PROXY_PORT,
    PROXY_TIMEOUT,
    PROXY_CONNECT_TIMEOUT,
    PROXY_MISSES_TOLERATED,
    PROXY_GREATEST_LEAD,
    PROXY_ON_LOSS,
    PROXY_RESUME,
    PROXY_ON_LIMIT,
    PROXY_KEY_FILE,
    PROXY_NAME,
    PROXY_BUILD,
    PROXY_HOLDS,
    PROXY_FAILSAFES = PROXY_HOLDS + N_ANSWER,
    PROXY_SENT_LIMITS = PROXY_FAILSAFES + N_ANSWER,
    PROXY_MEASURED_LIMITS = PROXY_SENT_LIMITS + 3 * N_SENT,
    PROXY_STATE = PROXY_MEASURED_LIMITS + 3 * N_MEASURED,
    PROXY_MISSED,
    PROXY_CONSECUTIVE_MISSED,
    PROXY_LATE,
    PROXY_OUT_OF_ORDER,
    PROXY_DUPLICATED,
    PROXY_REJECTED,
    PROXY_SESSIONS,
    PROXY_TRIPS,
    PROXY_LIMITED,
    PROXY_IMPLAUSIBLE,
    PROXY_ROUND_TRIP_TIME,
    PROXY_AGE,
    PROXY_LEAD
};

typedef struct {
    int state, on_loss, on_limit;
    uint64_t missed;             /* in a row */
    uint64_t limited, implausible;
    uint64_t taken;              /* the sequence of the answer that the outputs are of */
    uint64_t refused_answer;     /* of the last one that was implausible */
    double taken_time, lead;     /* s: what they belong to; of the newest answer in time */
    double sent[N_SENT + 1], sent_time;  /* the inputs that went out last; when, in s */
    uint8_t request[REQUEST_SIZE + 1];   /* the values that go to the peer */
    uint8_t answered[REQUEST_SIZE + 1];  /* those that it was initialised with */
    int is_initialised;
    Text loss;                          /* why the peer is lost */
    int is_connected;
    char host[NET_HOST_SIZE], key_file[NET_HOST_SIZE];  /* to what */
    double port;
    Channel channel;
} Model;

#include "slave.h"

static const char *const proxy_on_loss[] = {"hold", "failsafe", "stop"};
static const char *const proxy_on_limit[] = {"clamp", "trip"};

/* Messages */

static Text *proxy_put_peer(Slave *s, Text *said)
{
    const char *host = slave_string(s, PROXY_HOST);
    int bare = strchr(host, ':') != NULL && *host != '[';  /* an address of IPv6 */
    text_say(said, bare ? "[%s]:%d" : "%s:%d", host, (int)s->values[PROXY_PORT]);
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
        text_put(said, "the peer does not know this session: it was started again, or another proxy "
                       "has taken over");
        break;
    case WIRE_OTHER_NAME:
        text_say(said, "another name: %s; are two ports swapped?", c->client.reason);
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

/* The place of a word among so many; less than 0: it is none of them */
static int proxy_choice(const char *word, const char *const *words, int n)
{
    int i;
    for (i = n - 1; i >= 0 && strcmp(word, words[i]) != 0; i--) {
    }
    return i;
}

static Status proxy_read_settings(Slave *s)
{
    const char *on_loss = slave_string(s, PROXY_ON_LOSS), *on_limit = slave_string(s, PROXY_ON_LIMIT);
    s->model.on_loss = proxy_choice(on_loss, proxy_on_loss, STOP + 1);
    s->model.on_limit = proxy_choice(on_limit, proxy_on_limit, TRIP + 1);
    if (s->model.on_loss < 0) {
        return slave_refuse(s, "proxy.on_loss = %s: must be hold, failsafe, stop", on_loss);
    }
    if (s->model.on_limit < 0) {
        return slave_refuse(s, "proxy.on_limit = %s: must be clamp, trip", on_limit);
    }
    s->params_are_read = 1;
    return SLAVE_OK;
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
    if (c->refused || c->busy) {
        c->refused = c->refused ? c->refused : WIRE_BUSY;
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
    m->channel.refused = m->channel.busy = 0;
    m->channel.trouble[0] = '\0';
    m->channel.again = 0;
    m->is_connected = 1;
    m->is_initialised = 0;
    return SLAVE_OK;
}

/* The peer must be the one that is wanted; what it says of itself takes the place of "any". */
static Status proxy_check_peer(Slave *s)
{
    const Client *c = &s->model.channel.client;
    char *build = slave_string(s, PROXY_BUILD);
    const char *wrong = NULL;
    if (*c->name && *c->wanted && strcmp(c->name, c->wanted) != 0) {
        wrong = "name";
    } else if (*build && strcmp(c->build, build) != 0) {
        wrong = "build";
    }
    if (wrong) {
        int is_name = *wrong == 'n';
        slave_end(s);
        text_say(proxy_put_peer(s, slave_say(s)), ": the peer's %s is %s: must be %s", wrong,
                 is_name ? c->name : *c->build ? c->build : "empty", is_name ? c->wanted : build);
        return slave_refused(s);
    }
    strcpy(build, c->build);
    strcpy(slave_string(s, PROXY_NAME), c->name);
    return SLAVE_OK;
}

/* The name of the peer that is wanted: that of the settings, or of this instance where it fits */
static void proxy_want(Slave *s)
{
    const char *name = slave_string(s, PROXY_NAME);
    char *wanted = s->model.channel.client.wanted;
    size_t i, size;
    name = *name ? name : s->name;
    size = strlen(name);
    size = size < WIRE_NAME_SIZE ? size : WIRE_NAME_SIZE - 1;
    for (i = 0; i < size; i++) {
        wanted[i] = (char)(name[i] >= ' ' && name[i] <= '~' ? name[i] : '?');
    }
    memset(wanted + size, 0, WIRE_NAME_SIZE - size);
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
    proxy_want(s);
    if (!channel_greet(&m->channel, proxy_deadline(s, PROXY_CONNECT_TIMEOUT))) {
        return proxy_give_up(s);
    }
    if (proxy_check_peer(s) != SLAVE_OK) {
        return SLAVE_ERROR;
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

/* The limits of a Real that is sent, or measured: its lowest and highest value, and rate per s */
static const double *proxy_limits(const Slave *s, int first, int i)
{
    return &s->values[first + 3 * i];
}

/* Keep what is to be sent `over` s after the last within its limits: 1 if nothing was beyond. */
static int proxy_limit(Slave *s, double over)
{
    Model *m = &s->model;
    int i, within = 1;
    for (i = 0; i < N_SENT; i++) {
        const double *limits = proxy_limits(s, PROXY_SENT_LIMITS, i);
        double value = s->values[sent_reals[i]], limited = value;
        if (limits[2] > 0.0 && over > 0.0) {
            double change = limits[2] * over;
            limited = fmin(fmax(limited, m->sent[i] - change), m->sent[i] + change);
        }
        limited = fmin(fmax(limited, limits[0]), limits[1]);
        if (limited != value) {
            within = 0;
            m->limited++;
        }
        wire_put_real(m->request + 8 * sent_reals[i], limited);
    }
    return within;
}

/* What goes out now: later rates are relative to it. */
static void proxy_note_sent(Slave *s, double time)
{
    int i;
    for (i = 0; i < N_SENT; i++) {
        s->model.sent[i] = wire_get_real(s->model.request + 8 * sent_reals[i]);
    }
    s->model.sent_time = time;
}

/* Whether the newest answer has what can have been measured, after the one that was taken last */
static int proxy_is_plausible(const Slave *s)
{
    const Client *c = &s->model.channel.client;
    double over = c->outputs_time - s->model.taken_time;
    int i;
    for (i = 0; i < N_MEASURED; i++) {
        const double *limits = proxy_limits(s, PROXY_MEASURED_LIMITS, i);
        int place = measured_reals[i];
        double value = wire_get_real(c->outputs + 8 * (place - PROXY_OUTPUTS));
        double change = fabs(value - s->values[place]);
        if (value < limits[0] || value > limits[1]
            || (limits[2] > 0.0 && over > 0.0 && s->model.taken > 0 && change > limits[2] * over)) {
            return 0;
        }
    }
    return 1;
}

/* The outputs of the newest answer, if that is another one than before; 0 where it is implausible,
   and the outputs stay. */
static int proxy_take(Slave *s)
{
    const Client *c = &s->model.channel.client;
    const uint8_t *at = c->outputs;
    int i;
    if (c->newest == s->model.taken) {
        return 1;
    }
    if (!proxy_is_plausible(s)) {
        s->model.implausible += c->newest != s->model.refused_answer;
        s->model.refused_answer = c->newest;
        return 0;
    }
    for (i = PROXY_OUTPUTS; i < PROXY_OUTPUTS + N_ANSWER; i++, at += 8) {
        s->values[i] = variables[i].kind == KIND_REAL ? wire_get_real(at) : wire_get_integer(at);
    }
    s->model.taken = c->newest;
    s->model.taken_time = c->outputs_time;
    return 1;
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
    v[PROXY_TRIPS] = proxy_count(client->trips);
    v[PROXY_LIMITED] = proxy_count(s->model.limited);
    v[PROXY_IMPLAUSIBLE] = proxy_count(s->model.implausible);
    v[PROXY_ROUND_TRIP_TIME] = (double)client->round_trip / 1e9;
    v[PROXY_AGE] = v[SLAVE_TIME] - s->model.taken_time;
    v[PROXY_LEAD] = s->model.lead;
}

/* In initialisation mode exchange values, if they are others than before: what is measured is
   measured once. */
static Status proxy_initialise(Slave *s)
{
    Model *m = &s->model;
    if (proxy_connect(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    proxy_pack(s);
    if (!proxy_limit(s, 0.0) && m->on_limit == TRIP) {
        return slave_refuse(s, "an input is beyond its limits, and proxy.on_limit = trip");
    }
    if (m->is_initialised && memcmp(m->request, m->answered, REQUEST_SIZE) == 0) {
        return SLAVE_OK;
    }
    m->taken = 0;
    if (!channel_initialise(&m->channel, s->values[SLAVE_TIME], m->request,
                            proxy_deadline(s, PROXY_CONNECT_TIMEOUT))) {
        return proxy_give_up(s);
    }
    memcpy(m->answered, m->request, REQUEST_SIZE);
    m->is_initialised = 1;
    if (!proxy_take(s)) {
        return slave_refuse(s, "the peer answers what is beyond proxy.lowest.* and proxy.highest.*");
    }
    proxy_note_sent(s, s->values[SLAVE_TIME]);
    return SLAVE_OK;
}

/* In initialisation mode exchange values; after that outputs do not follow a set */
static Status slave_refresh(Slave *s)
{
    if (s->phase == INITIALISING && proxy_initialise(s) != SLAVE_OK) {
        return SLAVE_ERROR;
    }
    s->outputs_follow |= s->phase == INITIALISING || s->phase == STEPPING;
    return SLAVE_OK;
}

/* The life cycle */

static Status slave_start(Slave *s)
{
    Model *m = &s->model;
    slave_start_values(s);
    m->state = NOT_CONNECTED;
    m->missed = m->limited = m->implausible = m->taken = m->refused_answer = 0;
    m->lead = m->taken_time = 0.0;
    m->is_connected = m->is_initialised = 0;
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

/* The peer is given up, as m->loss says: its session is over, and no command goes out any more. */
static void proxy_lose(Slave *s)
{
    Model *m = &s->model;
    m->state = LOST;
    channel_end(&m->channel);
    if (m->on_loss == STOP) {
        return;
    }
    text_say(slave_say(s), "%s; proxy.on_loss = %s", m->loss.at, proxy_on_loss[m->on_loss]);
    slave_log(s, SLAVE_WARNING);
    if (m->on_loss == FAILSAFE) {
        proxy_take_failsafe(s);
    }
}

/* HOST:PORT is lost: - the beginning of why */
static Text *proxy_say_loss(Slave *s)
{
    text_clear(&s->model.loss);
    text_put(proxy_put_peer(s, &s->model.loss), " is lost: ");
    return &s->model.loss;
}

static void proxy_note_miss(Slave *s)
{
    Model *m = &s->model;
    m->missed++;
    m->state = MISSING;
    if (m->channel.refused) {
        proxy_put_refusal(&m->channel, proxy_say_loss(s));
        proxy_lose(s);
    } else if ((double)m->missed > s->values[PROXY_MISSES_TOLERATED]) {
        text_say(proxy_say_loss(s), "%d missed in a row: no answer", (int)proxy_count(m->missed));
        proxy_put_silence(s, PROXY_TIMEOUT, &m->loss);
        proxy_lose(s);
    }
}

/* An answer came in time: 1 if it is of a loop that is closed. The peer is lost where it tells that it
   tripped, or what time it is in, and then its outputs are not taken. */
static int proxy_is_closed(Slave *s, double end)
{
    Model *m = &s->model;
    const Client *c = &m->channel.client;
    double greatest = s->values[PROXY_GREATEST_LEAD];
    m->lead = c->outputs_time - end;
    if (c->trips > 0) {
        text_put(proxy_say_loss(s), "its watchdog or a limit of its own tripped, it is in its safe state");
    } else if (!(fabs(m->lead) <= greatest)) {
        text_say(proxy_say_loss(s), "its clock is %g s %s: must be within %g s (proxy.greatest_lead)",
                 fabs(m->lead), m->lead > 0.0 ? "ahead" : "behind; does the run keep to the clock", greatest);
    } else {
        return 1;
    }
    proxy_lose(s);
    return 0;
}

static void proxy_note_answer(Slave *s)
{
    s->model.state = CONNECTED;
    s->model.missed = 0;
}

/* Send inputs and parameters, wait for the outputs; without them, hold or lose */
static void proxy_exchange(Slave *s, double time, double h)
{
    Model *m = &s->model;
    int answered;
    proxy_pack(s);
    if (!proxy_limit(s, time + h - m->sent_time) && m->on_limit == TRIP) {
        text_put(proxy_say_loss(s), "a command was beyond its limits, and proxy.on_limit = trip");
        proxy_lose(s);
        return;
    }
    answered = channel_step(&m->channel, time, h, m->request, proxy_deadline(s, PROXY_TIMEOUT));
    proxy_note_sent(s, time + h);
    if (answered && !proxy_is_closed(s, time + h)) {
        return;
    }
    if (!proxy_take(s) && answered) {
        m->channel.client.counters.missed++;
        answered = 0;
    }
    if (answered) {
        proxy_note_answer(s);
    } else {
        proxy_note_miss(s);
    }
}

/* A lost peer that answers is back: its host must initialise all, before it gets a command again. */
static void proxy_look_for(Slave *s)
{
    if (channel_probe(&s->model.channel, proxy_deadline(s, PROXY_TIMEOUT))) {
        s->model.state = BACK;
        text_put(proxy_put_peer(s, slave_say(s)),
                 ": the peer answers again; it gets no commands before the loop is initialised again");
        slave_log(s, SLAVE_WARNING);
    }
}

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
    if (m->state == CONNECTED || m->state == MISSING) {
        proxy_exchange(s, time, h);
    } else if (m->state == LOST && s->values[PROXY_RESUME] != 0.0) {
        proxy_look_for(s);
    }
    if (m->state == LOST && m->on_loss == STOP) {
        proxy_report(s);
        return slave_refuse(s, "%s", m->loss.at);
    }
    s->values[SLAVE_TIME] = time + h;
    proxy_report(s);
    return SLAVE_OK;
}

#endif
