/* The proxy's side of a session: makes requests, judges what comes back, counts. No sockets.

   Before it is included: wire.h, and of the variables exchanged
       N_REQUEST, N_ANSWER          their numbers: inputs and parameters, outputs
       REQUEST_SIZE, ANSWER_SIZE    the bytes of their values, eight each
       variables                    their table, in this order */
#ifndef CLIENT_H
#define CLIENT_H

#define CLIENT_WINDOW 4096  /* requests back of which is known whether they were answered */
#define CLIENT_REASON 1024  /* bytes of a reason, at most */

enum { CLIENT_NOTHING, CLIENT_ANSWERED, CLIENT_REFUSED };  /* verdicts on a datagram */

typedef struct {
    uint64_t missed, late, out_of_order, duplicated, rejected;
} ClientCounters;

typedef struct {
    ClientCounters counters;
    int refused;  /* the code of the last REFUSE, from a peer of this version of the protocol */
    unsigned version;
    char reason[CLIENT_REASON + 1];
    uint8_t outputs[ANSWER_SIZE + 1];  /* of the newest answer */
    double outputs_time;               /* s: what they belong to */
    int64_t round_trip;                /* ns: from its request to the newest answer */

    wire_sealer sealer;
    uint64_t session, cookie, sequence, first_step, newest, awaited;
    int greeting;
    uint8_t seen[CLIENT_WINDOW];  /* 1: the request with this sequence, modulo, was answered */
} Client;

/* Returns 0 where the key is too short; NULL: no key. */
static int client_begin(Client *client, const uint8_t *key, size_t size)
{
    memset(client, 0, sizeof *client);
    return wire_sealer_init(&client->sealer, key, size);
}

/* Requests. The body is at datagram + WIRE_HEAD_SIZE already; the size of the whole is returned. */

static size_t client_pack(const Client *client, uint8_t kind, double time, double step, int64_t now,
                          size_t body, uint8_t *datagram)
{
    memset(datagram, 0, WIRE_HEAD_SIZE);
    memcpy(datagram, "GRSP", 4);
    wire_put(datagram + WIRE_AT_VERSION, 2, WIRE_VERSION);
    datagram[WIRE_AT_KIND] = kind;
    memcpy(datagram + WIRE_AT_INTERFACE, wire_hash(), 16);
    wire_put(datagram + WIRE_AT_SESSION, 8, client->session);
    wire_put(datagram + WIRE_AT_COOKIE, 8, client->cookie);
    wire_put(datagram + WIRE_AT_SEQUENCE, 8, client->sequence);
    wire_put_real(datagram + WIRE_AT_TIME, time);
    wire_put_real(datagram + WIRE_AT_STEP, step);
    wire_put(datagram + WIRE_AT_SENT, 8, (uint64_t)now);
    wire_put(datagram + WIRE_AT_SIZE, 4, body);
    return wire_seal(&client->sealer, datagram, WIRE_HEAD_SIZE + body);
}

/* HELLO, to begin a session of that number */
static size_t client_greet(Client *client, uint64_t session, int64_t now, uint8_t *datagram)
{
    const char *const *line;
    size_t size = 0;
    client->session = session;
    client->cookie = client->sequence = client->first_step = client->newest = client->awaited = 0;
    client->greeting = 1;
    client->refused = 0;
    memset(datagram + WIRE_HEAD_SIZE, 0, WIRE_SHORTEST_HELLO);
    for (line = wire_lines(); *line; line++) {
        memcpy(datagram + WIRE_HEAD_SIZE + size, *line, strlen(*line));
        size += strlen(*line);
    }
    size = size > WIRE_SHORTEST_HELLO ? size : WIRE_SHORTEST_HELLO;
    return client_pack(client, WIRE_HELLO, 0.0, 0.0, now, size, datagram);
}

/* INITIALISE, or a STEP over `step`, both from `time` in s */
static size_t client_ask(Client *client, uint8_t kind, double time, double step, int64_t now,
                         uint8_t *datagram)
{
    client->awaited = ++client->sequence;
    client->seen[client->sequence % CLIENT_WINDOW] = 0;
    if (kind == WIRE_STEP && !client->first_step) {
        client->first_step = client->sequence;
    }
    return client_pack(client, kind, time, step, now, REQUEST_SIZE, datagram);
}

/* Give up the step under way; its answer is late from now on */
static void client_miss(Client *client)
{
    client->awaited = 0;
    client->counters.missed++;
}

/* Answers */

static int client_reject(Client *client)
{
    client->counters.rejected++;
    return CLIENT_NOTHING;
}

static int client_receive_welcome(Client *client, const uint8_t *datagram, size_t body, int64_t now)
{
    uint64_t cookie = wire_get(datagram + WIRE_AT_COOKIE, 8);
    if (memcmp(datagram + WIRE_AT_INTERFACE, wire_hash(), 16) != 0 || !cookie || body > 0) {
        return client_reject(client);
    }
    if (!client->greeting) {  /* the peer answers a repeated HELLO again */
        return cookie == client->cookie ? CLIENT_NOTHING : client_reject(client);
    }
    client->greeting = 0;
    client->cookie = cookie;
    client->round_trip = (int64_t)((uint64_t)now - wire_get(datagram + WIRE_AT_SENT, 8));
    return CLIENT_ANSWERED;
}

static int client_receive_refusal(Client *client, const uint8_t *datagram, size_t body)
{
    uint64_t sequence = wire_get(datagram + WIRE_AT_SEQUENCE, 8);
    uint8_t code = datagram[WIRE_AT_CODE];
    if (sequence != (client->greeting ? 0 : client->awaited)
        || wire_get(datagram + WIRE_AT_COOKIE, 8) != client->cookie
        || !(client->greeting || client->awaited) || code < WIRE_OTHER_INTERFACE
        || code > WIRE_OTHER_VERSION) {
        return client_reject(client);
    }
    client->refused = code;
    client->version = (unsigned)wire_get(datagram + WIRE_AT_VERSION, 2);
    body = body < CLIENT_REASON ? body : CLIENT_REASON;
    client->reason[body] = '\0';
    while (body-- > 0) {  /* one line of ASCII, whatever it is */
        uint8_t c = datagram[WIRE_HEAD_SIZE + body];
        client->reason[body] = (char)(c < 0x20 ? ' ' : c < 0x7f ? c : '?');
    }
    return CLIENT_REFUSED;
}

static int client_are_outputs(const uint8_t *body, size_t size)
{
    int i, right = size == ANSWER_SIZE;
    for (i = N_REQUEST; right && i < N_REQUEST + N_ANSWER; i++, body += 8) {
        int kind = variables[i].kind;
        right = kind == KIND_REAL      ? wire_is_real(body)
                : kind == KIND_BOOLEAN ? wire_is_boolean(body) : wire_is_integer(body);
    }
    return right;
}

static int client_receive_outputs(Client *client, const uint8_t *datagram, size_t body, int64_t now)
{
    uint64_t sequence = wire_get(datagram + WIRE_AT_SEQUENCE, 8);
    int awaited = sequence == client->awaited;
    uint8_t *seen = &client->seen[sequence % CLIENT_WINDOW];
    if (memcmp(datagram + WIRE_AT_INTERFACE, wire_hash(), 16) != 0 || sequence < 1
        || sequence > client->sequence || !client_are_outputs(datagram + WIRE_HEAD_SIZE, body)) {
        return client_reject(client);
    }
    if (client->sequence - sequence >= CLIENT_WINDOW || *seen) {
        client->counters.duplicated += client->first_step > 0 && sequence >= client->first_step;
        return CLIENT_NOTHING;
    }
    *seen = 1;
    if (!awaited && sequence >= client->first_step) {
        client->counters.late++;
        client->counters.out_of_order += sequence < client->newest;
    }
    if (sequence > client->newest) {
        client->newest = sequence;
        memcpy(client->outputs, datagram + WIRE_HEAD_SIZE, body);
        client->outputs_time = wire_get_real(datagram + WIRE_AT_TIME);
        client->round_trip = (int64_t)((uint64_t)now - wire_get(datagram + WIRE_AT_SENT, 8));
    }
    if (awaited) {
        client->awaited = 0;
    }
    return awaited ? CLIENT_ANSWERED : CLIENT_NOTHING;
}

/* The verdict on a datagram, whatever it holds; of another version only its name is understood */
static int client_receive(Client *client, const uint8_t *datagram, size_t size, int64_t now)
{
    size_t body;
    uint8_t kind;
    if (wire_open(&client->sealer, datagram, size, &body) != WIRE_OPENED
        || wire_get(datagram + WIRE_AT_SESSION, 8) != client->session) {
        return client_reject(client);
    }
    kind = datagram[WIRE_AT_KIND];
    if ((wire_get(datagram + WIRE_AT_VERSION, 2) != WIRE_VERSION)
        != (kind == WIRE_REFUSE && datagram[WIRE_AT_CODE] == WIRE_OTHER_VERSION)) {
        return client_reject(client);
    }
    if (kind == WIRE_OUTPUTS && !client->greeting
        && wire_get(datagram + WIRE_AT_COOKIE, 8) == client->cookie) {
        return client_receive_outputs(client, datagram, body, now);
    }
    return kind == WIRE_WELCOME  ? client_receive_welcome(client, datagram, body, now)
           : kind == WIRE_REFUSE ? client_receive_refusal(client, datagram, body)
                                 : client_reject(client);
}

#endif
