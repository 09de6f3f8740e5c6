/* The link of the model EveryKind, driven from a pipe. Numbers in the byte order of this machine.
 *
 *   driver link KEY       reads  i64 now, u32 size, datagram  again and again; writes a Record and
 *                         the answer for each, and at the end the counters
 *   driver hmac           reads  u32 size, key, u32 size, data;  writes SHA-256, HMAC of data
 *
 * KEY - is none. The model: what came in, turned round; p.integer 13 fails, 14 gives no answer.
 */
#include "every_kind.h"

#include <stdio.h>
#include <stdlib.h>

enum { LARGEST = 70000, FAIL = 13, SILENT = 14 };
#define TIMEOUT_NS 400000000

typedef struct {
    double time, step, behind;
    uint32_t event, safe, fresh, size;
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
        record.safe = every_kind_link_watch(&link, now, TIMEOUT_NS);
        write_bytes(&record, sizeof record);
        write_bytes(answer, size);
    }
    write_bytes(&link.counters, sizeof link.counters);
    return 0;
}

static int digest(void)
{
    static uint8_t key[LARGEST], data[LARGEST];
    uint8_t result[32];
    every_kind_hmac_key prepared;
    uint32_t key_size = read_sized(key), size = read_sized(data);
    every_kind_sha256 sha;
    every_kind_sha256_begin(&sha);
    every_kind_sha256_add(&sha, data, size / 2);
    every_kind_sha256_add(&sha, data + size / 2, size - size / 2);
    every_kind_sha256_end(&sha, result);
    write_bytes(result, sizeof result);
    every_kind_hmac_prepare(&prepared, key, key_size);
    every_kind_hmac(&prepared, data, size, result);
    write_bytes(result, sizeof result);
    return 0;
}

int main(int count, char **words)
{
    const char *mode = count > 1 ? words[1] : "";
    if (!strcmp(mode, "link") && count == 3)
        return run(words[2]);
    if (!strcmp(mode, "hmac"))
        return digest();
    return 2;
}
