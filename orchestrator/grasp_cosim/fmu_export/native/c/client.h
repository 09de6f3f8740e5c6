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
    uint64_t trips;                    /* of the peer in this session, as the newest answer says */
    int64_t round_trip;                /* ns: from its request to the newest answer */
    char wanted[WIRE_NAME_SIZE];       /* the name of the peer; empty: any */
    char name[WIRE_NAME_SIZE], build[WIRE_BUILD_SIZE];  /* of the peer, as it welcomed */

    wire_sealer sealer;
    uint64_t session, cookie, sequence, first_step, newest, awaited;
    int greeting;
    const char *const *part;           /* the first line of the signature in the HELLO of now */
    int64_t greeted;                   /* ns: when that was made, which its answer returns */
    uint8_t seen[CLIENT_WINDOW];  /* 1: the request with this sequence, modulo, was answered */
} Client;

/* Returns 0 where the key is too short; NULL: no key. */
static int client_begin(Client *client, const uint8_t *key, size_t size)
{
    memset(client, 0, sizeof *client);
    return wire_sealer_init(&client->sealer, key, size);
}

/* Requests. The body is at datagram + WIRE_HEAD_SIZE already; the size of the whole is returned. */

/* The requests before this one, back to the newest one that is answered */
static uint64_t client_unanswered(const Client *client)
{
    uint64_t unanswered = client->sequence - 1 - client->newest;
    return unanswered < UINT32_MAX ? unanswered : UINT32_MAX;
}

static size_t client_pack(const Client *client, uint8_t kind, double time, double step, int64_t now,
                          size_t body, uint8_t *datagram)
{
    int counted = kind == WIRE_INITIALISE || kind == WIRE_STEP;
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
    wire_put(datagram + WIRE_AT_COUNT, 4, counted ? client_unanswered(client) : 0);
    return wire_seal(&client->sealer, datagram, WIRE_HEAD_SIZE + body);
}

static size_t client_bytes_before(const char *const *end)
{
    const char *const *line;
    size_t size = 0;
    for (line = wire_lines(); line != end; line++) {
        size += strlen(*line);
    }
    return size;
}

/* HELLO with the lines of the signature from client->part on, as many as there is room for */
static size_t client_hello(Client *client, int64_t now, uint8_t *datagram)
{
    uint8_t *body = datagram + WIRE_HEAD_SIZE;
    const char *const *line;
    size_t size = 0, offset = client_bytes_before(client->part);
    memset(body, 0, WIRE_HELLO_SIZE);
    memcpy(body + WIRE_HELLO_AT_NAME, client->wanted, sizeof client->wanted);
    for (line = client->part; *line && size + strlen(*line) <= WIRE_LARGEST_PART; line++) {
        memcpy(body + WIRE_HELLO_AT_PART + size, *line, strlen(*line));
        size += strlen(*line);
    }
    wire_put(body + WIRE_HELLO_AT_OFFSET, 4, offset);
    wire_put(body + WIRE_HELLO_AT_PART_SIZE, 4, size);
    while (*line) {
        line++;
    }
    wire_put(body + WIRE_HELLO_AT_WHOLE_SIZE, 4, client_bytes_before(line));
    client->greeted = now;
    return client_pack(client, WIRE_HELLO, 0.0, 0.0, now, WIRE_HELLO_SIZE, datagram);
}

/* The first HELLO, to begin a session of that number */
static size_t client_greet(Client *client, uint64_t session, int64_t now, uint8_t *datagram)
{
    client->session = session;
    client->cookie = client->sequence = client->first_step = client->newest = client->awaited = 0;
    client->trips = 0;
    client->greeting = 1;
    client->refused = 0;
    client->part = wire_lines();
    return client_hello(client, now, datagram);
}

/* The HELLO after one with which the peer's signature agreed; 0 where there are no more lines */
static size_t client_greet_on(Client *client, int64_t now, uint8_t *datagram)
{
    size_t size = 0;
    while (*client->part && size + strlen(*client->part) <= WIRE_LARGEST_PART) {
        size += strlen(*client->part++);
    }
    return *client->part ? client_hello(client, now, datagram) : 0;
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

/* A text of so many bytes, in one line of ASCII whatever it is */
static void client_take_text(char *text, const uint8_t *bytes, size_t size)
{
    size_t i;
    for (i = 0; i < size - 1 && bytes[i]; i++) {
        text[i] = (char)(bytes[i] < 0x20 ? ' ' : bytes[i] < 0x7f ? bytes[i] : '?');
    }
    text[i] = '\0';
}

static int client_receive_welcome(Client *client, const uint8_t *datagram, size_t body, int64_t now)
{
    uint64_t cookie = wire_get(datagram + WIRE_AT_COOKIE, 8);
    const uint8_t *name = datagram + WIRE_HEAD_SIZE;
    if (memcmp(datagram + WIRE_AT_INTERFACE, wire_hash(), 16) != 0 || !cookie
        || body != WIRE_NAME_SIZE + WIRE_BUILD_SIZE) {
        return client_reject(client);
    }
    if (!client->greeting) {  /* the peer answers a repeated HELLO again */
        return cookie == client->cookie ? CLIENT_NOTHING : client_reject(client);
    }
    client->greeting = 0;
    client->cookie = cookie;
    client_take_text(client->name, name, WIRE_NAME_SIZE);
    client_take_text(client->build, name + WIRE_NAME_SIZE, WIRE_BUILD_SIZE);
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
        || code > WIRE_OTHER_NAME
        || (client->greeting
            && wire_get(datagram + WIRE_AT_SENT, 8) != (uint64_t)client->greeted)) {
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
        client->trips = wire_get(datagram + WIRE_AT_COUNT, 4);
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
