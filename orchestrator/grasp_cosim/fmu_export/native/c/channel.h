/* A proxy's channel to its peer: the socket, and how long an answer is awaited. Times are ns of
   net_now(), or s of simulation. */
#ifndef CHANNEL_H
#define CHANNEL_H

#include "client.h"
#include "sockets.h"

#define CHANNEL_REPEAT 50000000  /* ns after which HELLO and INITIALISE are sent again */
#define CHANNEL_LOOKS 64         /* for an answer before it sleeps, as to be woken takes as long */

enum { CHANNEL_NEW, GREETING, WELCOME, CHANNEL_INITIALISING, READY };  /* stages */

typedef struct {
    Client client;
    Socket socket;
    int refused;                  /* the code by which the peer refused the last request, or 0 */
    int busy;                     /* 1: it was busy with another proxy since it last answered */
    char trouble[NET_TEXT_SIZE];  /* what the network reported; empty: nothing */
    uint64_t sessions;            /* begun */
    int stage;
    uint8_t pending[WIRE_LARGEST], request[WIRE_LARGEST], datagram[WIRE_LARGEST + 1];
    size_t pending_size;
    int64_t again;                /* when a lost peer is asked next */
} Channel;

static void channel_note(Channel *c, int error)
{
    if (error && !net_is_refused(error)) {  /* that nobody listens is what no answer means */
        net_error_text(error, c->trouble);
    }
}

static void channel_send(Channel *c, const uint8_t *request, size_t size)
{
    int i, error = 1;
    for (i = 0; i < 2 && error; i++) {  /* a call that reports an earlier one sends nothing */
        error = net_send(c->socket, request, size);
        channel_note(c, error);
    }
}

/* End the session, if there is one */
static void channel_end(Channel *c)
{
    if (c->stage > WELCOME) {
        size_t size = client_pack(&c->client, WIRE_END, 0.0, 0.0, net_now(), 0, c->request);
        (void)net_send(c->socket, c->request, size);
    }
    c->stage = CHANNEL_NEW;
    c->again = 0;
}

static void channel_close(Channel *c)
{
    channel_end(c);
    net_shut(c->socket);
}

/* What a datagram of so many bytes, or the failure to receive one, comes to */
static int channel_judge(Channel *c, long size, int error)
{
    int verdict = CLIENT_NOTHING;
    if (size == NET_FAILED) {
        channel_note(c, error);
    }
    if (size >= 0) {
        verdict = client_receive(&c->client, c->datagram, (size_t)size, net_now());
    }
    if (verdict == CLIENT_REFUSED) {
        c->refused = c->client.refused;
        if (c->refused == WIRE_BUSY) {  /* it may become free */
            c->busy = 1;
            verdict = CLIENT_NOTHING;
        }
    }
    return verdict;
}

/* Take one datagram, which is awaited for ns at most, and judge it */
static int channel_receive(Channel *c, int64_t ns)
{
    int error = 0, i;
    long size = NET_NOTHING;
    for (i = 0; size == NET_NOTHING && i < CHANNEL_LOOKS; i++) {
        net_yield();
        size = net_receive(c->socket, c->datagram, sizeof c->datagram, &error);
    }
    if (size == NET_NOTHING && net_wait(c->socket, ns)) {
        size = net_receive(c->socket, c->datagram, sizeof c->datagram, &error);
    }
    return channel_judge(c, size, error);
}

/* Send a request and wait for its answer until the deadline, whatever comes; 1 if it came */
static int channel_ask(Channel *c, const uint8_t *request, size_t size, int64_t deadline, int repeat)
{
    int64_t now = net_now(), again = now;
    int verdict = CLIENT_NOTHING;
    c->refused = 0;
    c->trouble[0] = '\0';
    for (; verdict == CLIENT_NOTHING && now < deadline; now = net_now()) {
        if (now >= again) {
            channel_send(c, request, size);
            again = repeat ? now + CHANNEL_REPEAT : deadline;
        }
        verdict = channel_receive(c, (again < deadline ? again : deadline) - now);
    }
    return verdict == CLIENT_ANSWERED;
}

/* Have the HELLO of another session ready; 0 where there are no random numbers */
static int channel_begin(Channel *c)
{
    uint64_t session;
    if (!net_random(&session, sizeof session)) {
        net_copy_text(c->trouble, "there are no random numbers");
        return 0;
    }
    c->pending_size = client_greet(&c->client, session, net_now(), c->pending);
    c->stage = GREETING;
    return 1;
}

/* Begin a session, or go on with what was begun; 1 if the peer welcomes it */
static int channel_greet(Channel *c, int64_t deadline)
{
    int more = 1;
    if (c->stage == CHANNEL_NEW && !channel_begin(c)) {
        return 0;
    }
    while (c->stage == GREETING && more) {
        more = 0;
        if (channel_ask(c, c->pending, c->pending_size, deadline, 1)) {
            c->stage = WELCOME;
            c->sessions++;
        } else if (c->refused == WIRE_OTHER_INTERFACE && !c->client.reason[0]) {
            /* where the two begin to differ is in a later part */
            size_t size = client_greet_on(&c->client, net_now(), c->pending);
            more = size > 0;
            c->pending_size = more ? size : c->pending_size;
        }
    }
    return c->stage > GREETING;
}

/* Ask a lost peer, until the deadline, whether it is there again: by HELLO, which carries no values.
   1 once it welcomes a session, which is not begun. */
static int channel_probe(Channel *c, int64_t deadline)
{
    int64_t now = net_now();
    if (c->stage == CHANNEL_NEW && !channel_begin(c)) {
        return 0;
    }
    for (; c->stage == GREETING && now < deadline; now = net_now()) {
        if (now >= c->again) {
            channel_send(c, c->pending, c->pending_size);
            c->again = now + CHANNEL_REPEAT;
        }
        if (channel_receive(c, (c->again < deadline ? c->again : deadline) - now)
            == CLIENT_ANSWERED) {
            c->stage = WELCOME;
        }
    }
    return c->stage == WELCOME;
}

/* Set values, or go on with what is under way; 1 if the outputs are there */
static int channel_initialise(Channel *c, double time, const uint8_t *values, int64_t deadline)
{
    do {
        if (!channel_greet(c, deadline)) {
            return 0;
        }
        if (c->stage != CHANNEL_INITIALISING) {
            memcpy(c->pending + WIRE_HEAD_SIZE, values, REQUEST_SIZE);
            c->pending_size =
                client_ask(&c->client, WIRE_INITIALISE, time, 0.0, net_now(), c->pending);
            c->stage = CHANNEL_INITIALISING;
        }
        if (channel_ask(c, c->pending, c->pending_size, deadline, 1)) {
            c->stage = READY;
            c->busy = 0;
        } else if (c->refused == WIRE_UNKNOWN || c->refused == WIRE_FAILED) {
            c->stage = CHANNEL_NEW;
        }
    } while (c->refused == WIRE_UNKNOWN);  /* another session was before this one */
    return c->stage == READY;
}

/* Step from `time` over `step`, both in s; 1 if the outputs came in time */
static int channel_step(Channel *c, double time, double step, const uint8_t *values,
                        int64_t deadline)
{
    size_t size;
    memcpy(c->request + WIRE_HEAD_SIZE, values, REQUEST_SIZE);
    size = client_ask(&c->client, WIRE_STEP, time, step, net_now(), c->request);
    if (channel_ask(c, c->request, size, deadline, 0)) {
        return 1;
    }
    client_miss(&c->client);
    return 0;
}

#endif
