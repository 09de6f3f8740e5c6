/* BLAKE2b (RFC 7693) with 16 bytes of digest and no key: the check sum in a serialised state. */
#ifndef BLAKE2B_H
#define BLAKE2B_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define BLAKE2B_SIZE 16  /* of the digest, in bytes */
#define BLAKE2B_BLOCK 128

typedef struct {
    uint64_t h[8];
    uint64_t length;  /* bytes so far, without those that wait */
    unsigned char waiting[BLAKE2B_BLOCK];
    size_t waiting_length;
} Blake2b;

static const uint64_t blake2b_start[8] = {
    0x6a09e667f3bcc908u, 0xbb67ae8584caa73bu, 0x3c6ef372fe94f82bu, 0xa54ff53a5f1d36f1u,
    0x510e527fade682d1u, 0x9b05688c2b3e6c1fu, 0x1f83d9abfb41bd6bu, 0x5be0cd19137e2179u};

static const unsigned char blake2b_order[10][16] = {
    {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15},
    {14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3},
    {11, 8, 12, 0, 5, 2, 15, 13, 10, 14, 3, 6, 7, 1, 9, 4},
    {7, 9, 3, 1, 13, 12, 11, 14, 2, 6, 5, 10, 4, 0, 15, 8},
    {9, 0, 5, 7, 2, 4, 10, 15, 14, 1, 11, 12, 6, 8, 3, 13},
    {2, 12, 6, 10, 0, 11, 8, 3, 4, 13, 7, 5, 15, 14, 1, 9},
    {12, 5, 1, 15, 14, 13, 4, 10, 0, 7, 6, 3, 9, 2, 8, 11},
    {13, 11, 7, 14, 12, 1, 3, 9, 5, 0, 15, 4, 8, 6, 2, 10},
    {6, 15, 14, 9, 11, 3, 0, 8, 12, 2, 13, 7, 1, 4, 10, 5},
    {10, 2, 8, 4, 7, 6, 1, 5, 15, 11, 9, 14, 3, 12, 13, 0}};

static uint64_t blake2b_rotated(uint64_t x, int bits)
{
    return x >> bits | x << (64 - bits);
}

static void blake2b_mix(uint64_t *a, uint64_t *b, uint64_t *c, uint64_t *d, uint64_t x, uint64_t y)
{
    *a += *b + x;
    *d = blake2b_rotated(*d ^ *a, 32);
    *c += *d;
    *b = blake2b_rotated(*b ^ *c, 24);
    *a += *b + y;
    *d = blake2b_rotated(*d ^ *a, 16);
    *c += *d;
    *b = blake2b_rotated(*b ^ *c, 63);
}

static void blake2b_compress(Blake2b *s, int last)
{
    uint64_t v[16], m[16];
    int i, k, round;
    for (i = 0; i < 16; i++) {
        v[i] = i < 8 ? s->h[i] : blake2b_start[i - 8];
        m[i] = 0;
        for (k = 7; k >= 0; k--) {
            m[i] = m[i] << 8 | s->waiting[8 * i + k];
        }
    }
    s->length += s->waiting_length;
    v[12] ^= s->length;
    v[14] = last ? ~v[14] : v[14];
    for (round = 0; round < 12; round++) {
        const unsigned char *o = blake2b_order[round % 10];
        for (i = 0; i < 4; i++) {
            blake2b_mix(&v[i], &v[4 + i], &v[8 + i], &v[12 + i], m[o[2 * i]], m[o[2 * i + 1]]);
        }
        for (i = 0; i < 4; i++) {
            blake2b_mix(&v[i], &v[4 + (i + 1) % 4], &v[8 + (i + 2) % 4], &v[12 + (i + 3) % 4],
                        m[o[8 + 2 * i]], m[o[9 + 2 * i]]);
        }
    }
    for (i = 0; i < 8; i++) {
        s->h[i] ^= v[i] ^ v[8 + i];
    }
    s->waiting_length = 0;
}

static void blake2b_begin(Blake2b *s)
{
    memset(s, 0, sizeof *s);
    memcpy(s->h, blake2b_start, sizeof s->h);
    s->h[0] ^= 0x01010000u ^ BLAKE2B_SIZE;
}

static void blake2b_add(Blake2b *s, const void *data, size_t size)
{
    const unsigned char *bytes = (const unsigned char *)data;
    size_t i;
    for (i = 0; i < size; i++) {
        if (s->waiting_length == BLAKE2B_BLOCK) {
            blake2b_compress(s, 0);  /* only now: the last block is told apart */
        }
        s->waiting[s->waiting_length++] = bytes[i];
    }
}

static void blake2b_end(Blake2b *s, unsigned char digest[BLAKE2B_SIZE])
{
    int i;
    memset(s->waiting + s->waiting_length, 0, BLAKE2B_BLOCK - s->waiting_length);
    blake2b_compress(s, 1);
    for (i = 0; i < BLAKE2B_SIZE; i++) {
        digest[i] = (unsigned char)(s->h[i / 8] >> 8 * (i % 8));
    }
}

#endif
