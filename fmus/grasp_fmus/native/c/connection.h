/* A proxy's connection to its peer: the socket, and how long an answer is awaited. It does what
   connection.py does. Times are ns of net_now(), or s of simulation. */
#ifndef CONNECTION_H
#define CONNECTION_H

#include "client.h"
#include "sockets.h"

#define CONNECTION_REPEAT 50000000  /* ns after which HELLO and INITIALISE are sent again */
#define CONNECTION_FILL 1024        /* bytes by which a HELLO is longer where the answer was cut */
#define CONNECTION_STALE 64         /* datagrams to take, at most, that came before a request */

enum { CONNECTION_NEW, GREETING, WELCOME, CONNECTION_INITIALISING, READY };  /* stages */

typedef struct {
    Client client;
    Socket socket;
    int refused;  /* the code by which the peer refused the last request; 0: it did not */
    char trouble[NET_TEXT_SIZE];  /* what the network reported; empty: nothing */
    uint64_t sessions;            /* begun */
    int stage;
    uint8_t pending[WIRE_LARGEST], request[WIRE_LARGEST], datagram[WIRE_LARGEST + 1];
    size_t pending_size;
} Connection;

static void connection_note(Connection *c, int error)
{
    if (!net_is_refused(error)) {  /* that nobody listens is what no answer means */
        net_error_text(error, c->trouble);
    }
}

static void connection_send(Connection *c, const uint8_t *request, size_t size)
{
    int i, error = 1;
    for (i = 0; i < 2 && error; i++) {  /* a call that reports an earlier one sends nothing */
        error = net_send(c->socket, request, size);
        if (error) {
            connection_note(c, error);
        }
    }
}

/* End the session, if there is one, and close the socket */
static void connection_close(Connection *c)
{
    if (c->stage > GREETING) {
        size_t size = client_pack(&c->client, WIRE_END, 0.0, 0.0, net_now(), 0, c->request);
        (void)net_send(c->socket, c->request, size);
    }
    net_shut(c->socket);
}

/* Take one datagram: a verdict, or NET_NOTHING where there is none */
static int connection_receive(Connection *c)
{
    int error, verdict;
    long size = net_receive(c->socket, c->datagram, sizeof c->datagram, &error);
    if (size == NET_NOTHING) {
        return NET_NOTHING;
    }
    if (size == NET_FAILED) {
        connection_note(c, error);
        return CLIENT_NOTHING;
    }
    verdict = client_receive(&c->client, c->datagram, (size_t)size, net_now());
    if (verdict == CLIENT_REFUSED) {
        c->refused = c->client.refused;
        if (c->refused == WIRE_BUSY) {
            return CLIENT_NOTHING;  /* it may become free */
        }
    }
    return verdict;
}

/* Take what came since the last request, up to an answer to one that is repeated */
static int connection_drain(Connection *c, int64_t deadline)
{
    int i, verdict;
    for (i = 0; i < CONNECTION_STALE; i++) {
        verdict = connection_receive(c);
        if (verdict != CLIENT_NOTHING) {
            return verdict == NET_NOTHING ? CLIENT_NOTHING : verdict;
        }
        if (net_now() >= deadline) {
            break;
        }
    }
    return CLIENT_NOTHING;
}

/* Send a request and wait for its answer until the deadline, whatever comes; 1 if it came */
static int connection_ask(Connection *c, const uint8_t *request, size_t size, int64_t deadline,
                          int repeat)
{
    int64_t now, again = 0;
    int verdict, sent = 0;
    c->refused = 0;
    c->trouble[0] = '\0';
    verdict = connection_drain(c, deadline);
    while (verdict == CLIENT_NOTHING && (now = net_now()) < deadline) {
        if (!sent || now >= again) {
            connection_send(c, request, size);
            again = repeat ? now + CONNECTION_REPEAT : deadline;
            sent = 1;
        }
        if (net_wait(c->socket, (again < deadline ? again : deadline) - now)) {
            verdict = connection_receive(c);
            verdict = verdict == NET_NOTHING ? CLIENT_NOTHING : verdict;
        }
    }
    return verdict == CLIENT_ANSWERED;
}

static int connection_hello(Connection *c, size_t fill)
{
    uint64_t session;
    if (!net_random(&session, sizeof session)) {
        net_copy_text(c->trouble, "there are no random numbers");
        return 0;
    }
    c->pending_size = client_greet(&c->client, session, net_now(), fill, c->pending);
    return 1;
}

/* Begin a session, or go on with what was begun; 1 if the peer welcomes it */
static int connection_greet(Connection *c, int64_t deadline)
{
    size_t fill = CONNECTION_FILL;
    if (c->stage == CONNECTION_NEW && connection_hello(c, 0)) {
        c->stage = GREETING;
    }
    while (c->stage == GREETING) {
        if (connection_ask(c, c->pending, c->pending_size, deadline, 1)) {
            c->stage = WELCOME;
            c->sessions++;
        } else if (c->refused && c->client.cut && fill <= WIRE_LARGEST
                   && connection_hello(c, fill)) {
            fill *= 4;
        } else {
            break;
        }
    }
    return c->stage > GREETING;
}

/* Set values, or go on with what is under way; 1 if the outputs are there */
static int connection_initialise(Connection *c, double time, const uint8_t *values, int64_t deadline)
{
    if (c->stage != CONNECTION_INITIALISING) {
        memcpy(c->pending + WIRE_HEAD_SIZE, values, REQUEST_SIZE);
        c->pending_size =
            client_ask(&c->client, WIRE_INITIALISE, time, 0.0, net_now(), c->pending);
        c->stage = CONNECTION_INITIALISING;
    }
    if (connection_ask(c, c->pending, c->pending_size, deadline, 1)) {
        c->stage = READY;
    } else if (c->refused == WIRE_UNKNOWN || c->refused == WIRE_FAILED) {
        c->stage = CONNECTION_NEW;
    }
    return c->stage == READY;
}

/* Step from `time` over `step`, both in s; 1 if the outputs came in time. With `anew`, begin another
   session where the peer does not know this one, or there is none. */
static int connection_step(Connection *c, double time, double step, const uint8_t *values,
                           int64_t deadline, int anew)
{
    size_t size;
    int i;
    for (i = 0; i < 2; i++) {
        if (c->stage != READY
            && !(connection_greet(c, deadline)
                 && connection_initialise(c, time, values, deadline))) {
            break;
        }
        memcpy(c->request + WIRE_HEAD_SIZE, values, REQUEST_SIZE);
        size = client_ask(&c->client, WIRE_STEP, time, step, net_now(), c->request);
        if (connection_ask(c, c->request, size, deadline, 0)) {
            return 1;
        }
        if (!anew || c->refused != WIRE_UNKNOWN) {
            break;
        }
        c->stage = CONNECTION_NEW;
    }
    if (c->stage == READY) {
        client_miss(&c->client);
    } else {  /* what is under way is awaited in the next step as well */
        c->client.counters.missed++;
    }
    return 0;
}

#endif
