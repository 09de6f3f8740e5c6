/* The bench side in C under libFuzzer: the input is what proxies send, and when.

   An input is a byte of settings, then a byte for each datagram, its size in two bytes, and then it. */
#include "every_kind.h"

#include <stdlib.h>

static const uint8_t *input, *input_end;

static unsigned take(void)
{
    return input < input_end ? *input++ : 0;
}

/* A head that the link may take to be one of a session it knows */
static void make_plausible(const every_kind_link *link, unsigned what, uint8_t *datagram, size_t size)
{
    uint64_t last = every_kind_get(link->request + EVERY_KIND_AT_SEQUENCE, 8);
    size_t tag = link->sealer.keyed ? (size_t)EVERY_KIND_TAG_SIZE : 0;
    if (size < EVERY_KIND_HEAD_SIZE + tag)
        return;
    memcpy(datagram, what & 64 ? "GRSP\1\0" : "GRSP\3\0", 6);
    memcpy(datagram + EVERY_KIND_AT_INTERFACE, every_kind_hash(), 16);
    every_kind_put(datagram + EVERY_KIND_AT_SIZE, 4, size - tag - EVERY_KIND_HEAD_SIZE);
    every_kind_put(datagram + EVERY_KIND_AT_COUNT, 4, 0);
    if (datagram[EVERY_KIND_AT_KIND] == EVERY_KIND_HELLO) {
        memset(datagram + EVERY_KIND_AT_COOKIE, 0, 16); /* and the sequence */
    } else if (link->live && what & 4) {
        every_kind_put(datagram + EVERY_KIND_AT_SESSION, 8, link->session);
        every_kind_put(datagram + EVERY_KIND_AT_COOKIE, 8, link->cookie);
        every_kind_put(datagram + EVERY_KIND_AT_SEQUENCE, 8, last + (what >> 4 & 3) - 1);
    } else {
        uint64_t session = every_kind_get(datagram + EVERY_KIND_AT_SESSION, 8);
        every_kind_put(datagram + EVERY_KIND_AT_COOKIE, 8, every_kind_link_cookie(link, session));
    }
}

static size_t compute(every_kind_link *link, uint8_t *answer)
{
    memcpy(&link->outputs.y_real, &link->inputs.u_real, sizeof link->outputs.y_real);
    return link->parameters.p_integer == 13 ? every_kind_link_fail(link, "thirteen", answer)
                                            : every_kind_link_answer(link, link->time, answer);
}

/* Judge a datagram in memory of exactly its size */
static void judge(every_kind_link *link, unsigned what, int64_t now)
{
    size_t size = take() | (size_t)take() << 8, left = (size_t)(input_end - input), n;
    uint8_t *datagram = (uint8_t *)calloc(1, size + 1);
    uint8_t *answer = (uint8_t *)malloc(EVERY_KIND_ANSWER_SIZE);
    every_kind_link_event event;
    memcpy(datagram, input, size < left ? size : left);
    input += size < left ? size : left;
    datagram = (uint8_t *)realloc(datagram, size ? size : 1);
    if (what & 1)
        make_plausible(link, what, datagram, size);
    if (what & 8 && size >= EVERY_KIND_HEAD_SIZE && datagram[EVERY_KIND_AT_KIND] == EVERY_KIND_HELLO)
        datagram[EVERY_KIND_AT_INTERFACE] ^= 1; /* of another interface */
    if (what & 2 && size >= EVERY_KIND_TAG_SIZE)
        every_kind_seal(&link->sealer, datagram, size - EVERY_KIND_TAG_SIZE);
    event = every_kind_link_receive(link, datagram, size, now, answer, &n);
    if ((event == EVERY_KIND_LINK_SEND) != (n > 0) || n > EVERY_KIND_ANSWER_SIZE)
        abort();
    if (!link->live && n > size)
        abort(); /* nobody gains by asking in another's name */
    if (event == EVERY_KIND_LINK_INITIALISE || event == EVERY_KIND_LINK_STEP)
        n = compute(link, answer);
    free(datagram);
    free(answer);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const uint8_t random[] = "not at random...";
    static const uint8_t key[] = "a key of thirty-two bytes, or so";
    static every_kind_link link;
    uint64_t counted = 0, judged = 0;
    const uint64_t *counter;
    int64_t now = 0;
    size_t i;
    input = data;
    input_end = data + size;
    every_kind_link_init(&link, random, take() & 1 ? key : NULL, 32);
    while (input < input_end) {
        unsigned what = take();
        judge(&link, what, now);
        if (every_kind_link_watch(&link, now, 1000000000) && link.live && !link.tripped)
            abort();
        now += what & 0x80 ? 2000000000 : 1000;
        judged++;
    }
    counter = (const uint64_t *)&link.counters;
    for (i = 0; i < sizeof link.counters / sizeof *counter; i++)
        counted += counter[i];
    if (counted > judged)
        abort();
    return 0;
}
