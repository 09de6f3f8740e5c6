/* Random commands for a slave: what is answered, refused, changed and measured; 1 where it is wrong. */
#include <stdio.h>
#include <stdlib.h>

#include "Model.h"

static Model_Memory memory = MODEL_MEMORY_DEFAULTS;
static xcp slave;
static uint64_t state = 1, sum;
static long measured;

static uint32_t any(uint32_t below)
{
    state = state * UINT64_C(6364136223846793005) + 1442695040888963407;
    return (uint32_t)(state >> 33) % below;
}

static void take(void *context, const uint8_t *datagram, size_t size)
{
    (void)context;
    measured++;
    while (size--)
        sum += datagram[size];
}

/* A datagram in memory of its own, so that whatever is read beyond it is found */
static size_t answer_to(const uint8_t *octets, size_t size, uint8_t *answer)
{
    uint8_t *datagram = malloc(size ? size : 1), *room = malloc(XCP_ANSWER_SIZE);
    size_t n;
    memcpy(datagram, octets, size);
    n = xcp_receive(&slave, datagram, size, any(1000), room);
    memcpy(answer, room, n);
    free(datagram);
    free(room);
    return n;
}

/* A command as a master would send it, with some of its bytes at random */
static size_t drawn(uint8_t *at)
{
    static const uint8_t codes[] = {0xFF, 0xFD, 0xFC, 0xFB, 0xFA, 0xF6, 0xF5, 0xF4, 0xF0, 0xE3,
        0xE2, 0xE1, 0xE1, 0xE1, 0xE0, 0xDE, 0xDD, 0xDC, 0xDA, 0xD9, 0xD7, 0xD5, 0xD4, 0xD3, 0xD6};
    size_t i, size = 4 + 1 + any(11), claimed;
    for (i = 4; i < 40; i++)
        at[i] = (uint8_t)(any(3) ? any(4) : any(256));
    at[4] = any(20) ? codes[any(sizeof codes)] : (uint8_t)any(256);
    if (at[4] == 0xFF && any(50))
        at[4] = 0xF6;
    if (at[4] == 0xF6 || at[4] == 0xF4 || at[4] == 0xE1) { /* mostly at the place of a variable */
        at[7] = any(30) == 0;
        xcp_put(at + 8, MODEL_XCP_ADDRESS + 8 * any(sizeof memory / 8 + 2) + (any(9) == 0), 4);
        size = any(20) ? 12 : size;
    }
    if (at[4] == 0xF0) {
        const double value = (double)any(400) / 100.0 - 1.0;
        at[5] = any(3) ? 8 : (uint8_t)any(20);
        memcpy(at + 6, &value, 8);
        size = 4 + 2 + (at[5] < 20U ? at[5] : 20U) - (any(30) == 0);
    }
    if (at[4] == 0xE1 && any(9))
        at[5] = 0xFF, at[6] = (uint8_t)(1 + any(8));
    if (at[4] == 0xE0 && any(9))
        at[5] = 0x10;
    claimed = any(30) ? size - 4 : any(65536);
    xcp_put(at, (uint32_t)claimed, 2);
    return any(30) ? size : any(60);
}

/* The commands by which a master begins to measure, each as it should be, or nearly so */
static void set_up(void)
{
    static const uint8_t commands[][8] = {{0xDD}, {0xD6}, {0xD5, 0, 1}, {0xD4, 0, 0, 0, 2},
        {0xD3, 0, 0, 0, 0, 2}, {0xD3, 0, 0, 0, 1, 1}, {0xE2}, {0xE1, 0xFF, 8}, {0xE1, 0xFF, 120},
        {0xE2, 0, 0, 0, 1}, {0xE1, 0xFF, 1}, {0xE0, 0x10, 0, 0, 0, 0, 1}, {0xDE, 1}};
    size_t i;
    for (i = 0; i < sizeof commands / sizeof *commands; i++) {
        uint8_t octets[12] = {8, 0, 0, 0}, answer[XCP_ANSWER_SIZE];
        memcpy(octets + 4, commands[i], 8);
        if (octets[4] == 0xE1)
            xcp_put(octets + 8, MODEL_XCP_ADDRESS, 4);
        if (any(20) == 0)
            octets[4 + any(8)] = (uint8_t)any(256);
        answer_to(octets, sizeof octets, answer);
    }
}

int main(int count, char **words)
{
    static const uint8_t connect[] = {2, 0, 0, 0, 0xFF, 0}, status[] = {1, 0, 0, 0, 0xFD};
    long k, answered = 0, refused = 0, changed = 0, most = count > 1 ? atol(words[1]) : 1000;
    uint8_t octets[64] = {0}, answer[XCP_ANSWER_SIZE];
    Model_Memory before;
    Model_xcp_init(&slave, &memory, MODEL_XCP_ADDRESS);
    if (answer_to(status, sizeof status, answer) || !answer_to(connect, sizeof connect, answer))
        return 1;
    for (k = 0; k < most; k++) {
        size_t n, size = drawn(octets);
        if (any(50) == 0)
            set_up();
        before = memory;
        n = answer_to(octets, size, answer);
        answered += n > 0;
        refused += n > 4 && answer[4] == 0xFE;
        changed += memcmp(&before, &memory, sizeof memory) != 0;
        if (memcmp(&before.inputs, &memory.inputs, sizeof memory - offsetof(Model_Memory, inputs)))
            return 2; /* what is read alone */
        if (Model_check(&memory.parameters, NULL))
            return 3;
        xcp_event(&slave, (uint32_t)k, take, NULL);
        if (any(100) == 0 && !answer_to(connect, sizeof connect, answer))
            return 4;
    }
    if (!answer_to(connect, sizeof connect, answer) || !answer_to(status, sizeof status, answer))
        return 5;
    printf("%ld %ld %ld %ld\n", answered, refused, changed, measured);
    return sum == 1; /* so it is used */
}
