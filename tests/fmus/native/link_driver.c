/* The link of the model EveryKind, driven from a pipe. Numbers in the byte order of this machine.
 *
 *   driver link KEY       reads  i64 now, u32 size, datagram  again and again; writes a Record and
 *                         the answer for each, and at the end the counters
 *   driver hmac           reads  u32 size, key, u32 size, data;  writes SHA-256, HMAC of data
 *   driver fuzz KEY N SEED    reads  u32 size, datagram  again and again; makes N others of them,
 *                         judges each in memory of exactly its size, writes the counters
 *
 * KEY - is none. The model: what came in, turned round; p.integer 13 fails, 14 gives no answer.
 */
#include "every_kind.h"

#include <stdio.h>
#include <stdlib.h>

enum { LARGEST = 70000, CORPUS = 64, FAIL = 13, SILENT = 14 };

typedef struct {
    double time, step, behind;
    uint32_t event, alive, fresh, size;
} Record;

static const uint8_t RANDOM[] = "not at random...";

static void write_bytes(const void *data, size_t size)
{
    if (fwrite(data, 1, size, stdout) != size)
        exit(3);
}

static bool read_bytes(void *data, size_t size)
{
    return fread(data, 1, size, stdin) == size;
}

static uint32_t read_sized(uint8_t *data)
{
    uint32_t size;
    if (!read_bytes(&size, sizeof size) || size > LARGEST || !read_bytes(data, size))
        exit(4);
    return size;
}

/* Returns the size of the answer. */
static size_t compute(every_kind_link *link, uint8_t *answer)
{
    const every_kind_inputs *u = &link->inputs;
    const every_kind_parameters *p = &link->parameters;
    every_kind_outputs *y = &link->outputs;
    y->y_real = -u->u_real;
    y->y_integer = u->u_integer ^ 0x55;
    y->y_boolean = !u->u_boolean;
    y->q_real = -p->p_real;
    y->q_integer = p->p_integer ^ 0x55;
    y->q_boolean = !p->p_boolean;
    if (p->p_integer == SILENT)
        return 0;
    return p->p_integer == FAIL ? every_kind_link_fail(link, "thirteen", answer)
                                : every_kind_link_answer(link, link->time + link->step, answer);
}

static void begin(every_kind_link *link, const char *key)
{
    const uint8_t *secret = strcmp(key, "-") ? (const uint8_t *)key : NULL;
    if (!every_kind_link_init(link, RANDOM, secret, strlen(key)))
        exit(5);
}

static int run(const char *key)
{
    static uint8_t datagram[LARGEST], answer[EVERY_KIND_ANSWER_SIZE];
    every_kind_link link;
    int64_t now;
    begin(&link, key);
    while (read_bytes(&now, sizeof now)) {
        uint32_t n = read_sized(datagram);
        size_t size;
        every_kind_link_event event;
        Record record;
        event = every_kind_link_receive(&link, datagram, n, now, answer, &size);
        if (event == EVERY_KIND_LINK_INITIALISE || event == EVERY_KIND_LINK_STEP)
            size = compute(&link, answer);
        memset(&record, 0, sizeof record);
        record.time = link.time, record.step = link.step, record.behind = link.behind;
        record.event = event, record.fresh = link.fresh, record.size = (uint32_t)size;
        record.alive = every_kind_link_alive(&link, now, 0);
        write_bytes(&record, sizeof record);
        write_bytes(answer, size);
    }
    write_bytes(&link.counters, sizeof link.counters);
    return 0;
}

static int digest(void)
{
    static uint8_t key[LARGEST], data[LARGEST];
    uint8_t block[64], result[32];
    uint32_t key_size = read_sized(key), size = read_sized(data);
    every_kind_sha256 sha;
    every_kind_sha256_begin(&sha);
    every_kind_sha256_add(&sha, data, size / 2);
    every_kind_sha256_add(&sha, data + size / 2, size - size / 2);
    every_kind_sha256_end(&sha, result);
    write_bytes(result, sizeof result);
    every_kind_hmac_key(key, key_size, block);
    every_kind_hmac(block, data, size, result);
    write_bytes(result, sizeof result);
    return 0;
}

static uint64_t state;

static uint32_t draw(uint32_t below)
{
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;
    return (uint32_t)(state >> 32) % below;
}

/* Mostly of a session that the link knows, with a sequence near the last. */
static void plausible(const every_kind_link *link, uint8_t *datagram)
{
    uint64_t last = every_kind_get(link->request + 40, 8);
    if (datagram[6] == EVERY_KIND_HELLO)
        return;
    if (link->live && draw(8)) {
        every_kind_put(datagram + 24, 8, link->session);
        every_kind_put(datagram + 32, 8, link->cookie);
    } else {
        uint64_t session = every_kind_get(datagram + 24, 8);
        every_kind_put(datagram + 32, 8, every_kind_link_cookie(link, session));
    }
    every_kind_put(datagram + 40, 8, last + draw(4) - draw(2));
}

static size_t mutated(uint8_t *datagram, size_t size)
{
    switch (draw(6)) {
    case 0:
        return draw((uint32_t)size + 1);
    case 1:
        memset(datagram + size, (int)draw(256), 256);
        return size + draw(256);
    case 2:
        every_kind_put(datagram + 72, 4, (uint64_t)draw(3000));
        return size;
    case 3:
        memset(datagram + 8 * draw((uint32_t)size / 8), draw(2) ? 0xff : 0x7f, 8);
        return size;
    default:
        datagram[draw((uint32_t)size)] = (uint8_t)draw(256);
        return size;
    }
}

/* The datagram under the key, of which the tag is taken to be the last 32 bytes. */
static void seal(const every_kind_link *link, uint8_t *datagram, size_t size)
{
    if (link->sealer.keyed && size >= 32)
        every_kind_hmac(link->sealer.key, datagram, size - 32, datagram + size - 32);
}

static void judge(every_kind_link *link, const uint8_t *datagram, size_t size, int64_t now)
{
    uint8_t *exact = (uint8_t *)malloc(size ? size : 1);
    uint8_t *answer = (uint8_t *)malloc(EVERY_KIND_ANSWER_SIZE);
    size_t n;
    every_kind_link_event event;
    if (!exact || !answer)
        exit(6);
    memcpy(exact, datagram, size);
    event = every_kind_link_receive(link, exact, size, now, answer, &n);
    if ((event == EVERY_KIND_LINK_SEND) != (n > 0) || n > EVERY_KIND_ANSWER_SIZE)
        exit(7);
    if (event == EVERY_KIND_LINK_INITIALISE || event == EVERY_KIND_LINK_STEP)
        compute(link, answer);
    free(exact);
    free(answer);
}

static int fuzz(const char *key, long count, uint64_t seed)
{
    static uint8_t corpus[CORPUS][LARGEST], datagram[LARGEST];
    static uint32_t sizes[CORPUS];
    uint32_t entries = 0;
    int64_t now = 0;
    int next;
    every_kind_link link;
    begin(&link, key);
    state = seed;
    while ((next = getchar()) != EOF && entries < CORPUS) {
        ungetc(next, stdin);
        sizes[entries] = read_sized(corpus[entries]);
        entries++;
    }
    while (count--) {
        uint32_t chosen = draw(entries), changes = draw(3);
        size_t size = sizes[chosen];
        memcpy(datagram, corpus[chosen], size);
        plausible(&link, datagram);
        while (changes-- && size >= 8)
            size = mutated(datagram, size);
        if (draw(16))
            seal(&link, datagram, size);
        now += draw(64) ? draw(1000000) : draw(2000000000);
        judge(&link, datagram, size, now);
    }
    write_bytes(&link.counters, sizeof link.counters);
    return 0;
}

int main(int count, char **words)
{
    const char *mode = count > 1 ? words[1] : "";
    if (!strcmp(mode, "link") && count == 3)
        return run(words[2]);
    if (!strcmp(mode, "hmac"))
        return digest();
    if (!strcmp(mode, "fuzz") && count == 5)
        return fuzz(words[2], strtol(words[3], NULL, 10), strtoull(words[4], NULL, 10));
    return 2;
}
