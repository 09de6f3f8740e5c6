/* Hands malformed datagrams to a side of the link, again and again: malformed KEY|- N, from standard
   input  u32 size, datagram  again and again; none has any effect, and each is counted, once.

   PROXY: the client in a native proxy; otherwise the bench side. In between a step is answered. It
   prints the counts, and how much memory it had after a tenth of them and in the end, in kB. */
#ifdef PROXY
#include "AnyProxy.c"
typedef Client Side;
#define OPEN(side, key, size) client_begin(side, key, size)
#else
#include "every_kind.h"
typedef every_kind_link Side;
#define OPEN(side, key, size) every_kind_link_init(side, (const uint8_t *)"not at random...", key, size)
#endif

#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>

enum { CORPUS = 512, LARGEST = 70000 };

static uint8_t corpus[CORPUS][LARGEST];
static uint32_t sizes[CORPUS];

static long kilobytes(void)
{
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
    return used.ru_maxrss;
}

#ifdef PROXY

static void begin(Side *side)
{
    side->session = 99;
    side->cookie = 5;
}

static unsigned long count(const Side *side)
{
    return (unsigned long)side->counters.rejected;
}

static int has_effect(Side *side, const uint8_t *datagram, size_t size)
{
    return client_receive(side, datagram, size, 0) != CLIENT_NOTHING || side->counters.late
           || side->counters.duplicated;
}

/* A step, and its answer */
static int steps(Side *side)
{
    static uint8_t datagram[WIRE_LARGEST];
    client_ask(side, WIRE_STEP, 0.0, 0.5, 0, datagram);
    memset(datagram + WIRE_HEAD_SIZE, 0, ANSWER_SIZE);
    return client_receive(side, datagram,
                          client_pack(side, WIRE_OUTPUTS, 0.5, 0.0, 0, ANSWER_SIZE, datagram), 0)
           == CLIENT_ANSWERED;
}

#else

static uint8_t answer[EVERY_KIND_ANSWER_SIZE], request[EVERY_KIND_LARGEST];

static every_kind_link_event ask(Side *side, uint8_t kind, uint64_t cookie, uint64_t sequence,
        double step, size_t body)
{
    size_t n;
    memset(request, 0, EVERY_KIND_HEAD_SIZE);
    memcpy(request, "GRSP\2", 5);
    request[EVERY_KIND_AT_KIND] = kind;
    memcpy(request + EVERY_KIND_AT_INTERFACE, every_kind_hash(), 16);
    every_kind_put(request + EVERY_KIND_AT_SESSION, 8, 99);
    every_kind_put(request + EVERY_KIND_AT_COOKIE, 8, cookie);
    every_kind_put(request + EVERY_KIND_AT_SEQUENCE, 8, sequence);
    every_kind_put_real(request + EVERY_KIND_AT_STEP, step);
    every_kind_put(request + EVERY_KIND_AT_SIZE, 4, body);
    n = every_kind_seal(&side->sealer, request, EVERY_KIND_HEAD_SIZE + body);
    return every_kind_link_receive(side, request, n, 0, answer, &n);
}

static void begin(Side *side)
{
    size_t body = EVERY_KIND_INPUTS_SIZE + EVERY_KIND_PARAMETERS_SIZE;
    ask(side, EVERY_KIND_HELLO, 0, 0, 0.0, 0);
    memset(request + EVERY_KIND_HEAD_SIZE, 0, body);
    ask(side, EVERY_KIND_INITIALISE, every_kind_get(answer + EVERY_KIND_AT_COOKIE, 8), 1, 0.0, body);
    every_kind_link_answer(side, 0.0, answer);
}

static unsigned long count(const Side *side)
{
    return (unsigned long)(side->counters.malformed + side->counters.forged);
}

static int has_effect(Side *side, const uint8_t *datagram, size_t size)
{
    size_t n;
    return every_kind_link_receive(side, datagram, size, 0, answer, &n) != EVERY_KIND_LINK_NOTHING;
}

static int steps(Side *side)
{
    size_t body = EVERY_KIND_INPUTS_SIZE + EVERY_KIND_PARAMETERS_SIZE;
    uint64_t last = every_kind_get(side->request + EVERY_KIND_AT_SEQUENCE, 8);
    memset(request + EVERY_KIND_HEAD_SIZE, 0, body);
    return ask(side, EVERY_KIND_STEP, side->cookie, last + 1, 0.5, body) == EVERY_KIND_LINK_STEP &&
           every_kind_link_answer(side, 0.5, answer) > 0;
}

#endif

int main(int words, char **word)
{
    static Side side;
    const uint8_t *key = words == 3 && strcmp(word[1], "-") ? (const uint8_t *)word[1] : NULL;
    unsigned long i, n = words == 3 ? strtoul(word[2], NULL, 10) : 0, entries = 0;
    long before = 0;
    while (entries < CORPUS && fread(&sizes[entries], sizeof *sizes, 1, stdin) == 1) {
        if (fread(corpus[entries], 1, sizes[entries], stdin) != sizes[entries])
            return 2;
        entries++;
    }
    OPEN(&side, key, key ? strlen(word[1]) : 0);
    begin(&side);
    if (!entries || !steps(&side))
        return 3;
    for (i = 0; i < n; i++) {
        if (has_effect(&side, corpus[i % entries], sizes[i % entries]) || count(&side) != i + 1) {
            printf("%lu\n", i % entries);
            return 4;
        }
        if (i % 1000 == 0 && !steps(&side))
            return 5;
        before = i == n / 10 ? kilobytes() : before;
    }
    printf("%lu %ld %ld\n", count(&side), before, kilobytes());
    return 0;
}
