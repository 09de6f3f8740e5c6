/* A native proxy under libFuzzer, from instantiation to its end: the input is what its peer sends,
   when, and with what the network fails. The clock stands still but for waiting.

   AnyProxy.c is that of the scripted peer's variables. An input is a byte of settings, then what comes:
   a byte that says what, of a datagram its size in two bytes and then it, or its body. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static ssize_t fuzz_recv(int at, void *to, size_t size, int flags);
static ssize_t fuzz_send(int at, const void *datagram, size_t size, int flags);
static int fuzz_wait(const struct timespec *most);
static int fuzz_clock(struct timespec *now);

#define recv fuzz_recv
#define send fuzz_send
#define pselect(n, sockets, a, b, most, c) ((void)(sockets), fuzz_wait(most))
#define clock_gettime(id, now) fuzz_clock(now)
#define socket(a, b, c) 3
#define connect(a, b, c) 0
#define fcntl(...) 0
#define close(a) ((void)(a))

#include "AnyProxy.c"

enum { NOTHING, REFUSED, UNREACHABLE, RAW, PLAUSIBLE };

static const uint8_t *input, *input_end;
static int64_t now_ns;
static uint8_t request[WIRE_HEAD_SIZE];
static wire_sealer sealer;
static char key_file[] = "/tmp/fuzz_key_XXXXXX";
static const uint8_t key[33] = "a key of thirty-two bytes, or so";

static unsigned take(void)
{
    return input < input_end ? *input++ : 0;
}

static int fuzz_clock(struct timespec *now)
{
    now->tv_sec = (time_t)(now_ns / NET_SECOND);
    now->tv_nsec = (long)(now_ns % NET_SECOND);
    return 0;
}

/* Whether something comes; if not, the time is over */
static int fuzz_wait(const struct timespec *most)
{
    if (input < input_end) {
        now_ns += 1000;
        return 1;
    }
    now_ns += (int64_t)most->tv_sec * NET_SECOND + most->tv_nsec;
    return 0;
}

static ssize_t fuzz_send(int at, const void *datagram, size_t size, int flags)
{
    (void)at, (void)flags;
    if (size < WIRE_HEAD_SIZE || size > WIRE_LARGEST) {
        abort();
    }
    memcpy(request, datagram, sizeof request);
    return (ssize_t)size;
}

static size_t taken(uint8_t *to, size_t most)
{
    size_t size = take() | (size_t)take() << 8, left = (size_t)(input_end - input);
    size = size < most ? size : most;
    memset(to, 0, size);
    memcpy(to, input, size < left ? size : left);
    input += size < left ? size : left;
    return size;
}

/* An answer to the last request, but for what the input spoils */
static size_t plausible(unsigned what, uint8_t *datagram)
{
    size_t body = taken(datagram + WIRE_HEAD_SIZE, WIRE_LARGEST - WIRE_HEAD_SIZE - WIRE_TAG_SIZE);
    unsigned spoilt = take();
    memcpy(datagram, request, WIRE_HEAD_SIZE);
    datagram[WIRE_AT_KIND] = what & 1 ? WIRE_OUTPUTS : what & 2 ? WIRE_REFUSE : WIRE_WELCOME;
    datagram[WIRE_AT_CODE] = (uint8_t)(what >> 2 & 7);
    if (datagram[WIRE_AT_KIND] == WIRE_WELCOME) {
        datagram[WIRE_AT_COOKIE] = (uint8_t)(1 + (what >> 5));
        if (!spoilt) {
            body = WIRE_NAME_SIZE + WIRE_BUILD_SIZE;
            memset(datagram + WIRE_HEAD_SIZE, 0, body);
        }
    }
    wire_put(datagram + WIRE_AT_COUNT, 4, 0);
    if (datagram[WIRE_AT_KIND] == WIRE_OUTPUTS) {
        wire_put(datagram + WIRE_AT_COUNT, 4, spoilt >> 3 & 1);
        body = spoilt & 1 ? body : ANSWER_SIZE;
        wire_put(datagram + WIRE_AT_SEQUENCE, 8,
                 wire_get(datagram + WIRE_AT_SEQUENCE, 8) - (spoilt >> 1 & 3));
    }
    if (datagram[WIRE_AT_CODE] == WIRE_OTHER_VERSION && !(spoilt & 8)) {
        datagram[WIRE_AT_VERSION]++;
    }
    if (spoilt > 0xf0) {
        datagram[take() % WIRE_HEAD_SIZE] = (uint8_t)take();
    }
    wire_put(datagram + WIRE_AT_SIZE, 4, body);
    return wire_seal(&sealer, datagram, WIRE_HEAD_SIZE + body);
}

static ssize_t fuzz_recv(int at, void *to, size_t size, int flags)
{
    unsigned what = take();
    (void)at, (void)flags;
    if (input == input_end || what % 16 == NOTHING) {
        errno = EAGAIN;
        return -1;
    }
    if (what % 16 == REFUSED || what % 16 == UNREACHABLE) {
        errno = what % 16 == REFUSED ? ECONNREFUSED : ENETUNREACH;
        return -1;
    }
    return (ssize_t)(what % 16 == RAW ? taken((uint8_t *)to, size)
                                      : plausible(what >> 1, (uint8_t *)to));
}

static void logged(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String message, ...)
{
    (void)environment, (void)name, (void)status, (void)category;
    for (; *message; message++) {
        if (*message < 0x20 || *message > 0x7e) {
            abort();
        }
    }
}

static void remove_key(void)
{
    unlink(key_file);
}

int LLVMFuzzerInitialize(int *count, char ***words);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *count, char ***words)
{
    int file = mkstemp(key_file);
    (void)count, (void)words;
    if (file < 0 || write(file, key, 32) != 32) {
        abort();
    }
    return atexit(remove_key);
}

static void set_texts(fmi2Component c, unsigned settings)
{
    static const char *const on_loss[] = {"hold", "failsafe", "stop", "panic"};
    fmi2ValueReference vrs[] = {PROXY_ON_LOSS, PROXY_KEY_FILE, PROXY_HOST, PROXY_ON_LIMIT};
    fmi2String texts[] = {on_loss[settings & 3], settings & 4 ? key_file : "", "127.0.0.1",
                          settings & 32 ? "trip" : "clamp"};
    wire_sealer_init(&sealer, settings & 4 ? key : NULL, 32);
    fmi2SetString(c, vrs, 4, texts);
}

static void check(const Slave *s)
{
    int i;
    for (i = 0; i < N_VARIABLES; i++) {
        if (variables[i].kind != KIND_STRING && i < PROXY_STATE && !slave_finite(s->values[i])) {
            abort();
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fmi2CallbackFunctions callbacks = {logged, NULL, NULL, NULL, NULL};
    fmi2ValueReference resume = PROXY_RESUME, output = PROXY_OUTPUTS, force = 0;
    fmi2ValueReference limits[] = {PROXY_SENT_LIMITS, PROXY_SENT_LIMITS + 1, PROXY_SENT_LIMITS + 2,
                                   PROXY_MEASURED_LIMITS, PROXY_MEASURED_LIMITS + 1,
                                   PROXY_MEASURED_LIMITS + 2};
    fmi2Real bounds[] = {-1.0, 3.0, 2.0, -1e3, 1e3, 5.0};
    fmi2Boolean resumes;
    fmi2Component c;
    double y;
    unsigned settings;
    int k;
    input = data;
    input_end = data + size;
    now_ns = 0;
    settings = take();
    resumes = settings >> 3 & 1;
    c = fmi2Instantiate("fuzz", fmi2CoSimulation, TOKEN, NULL, &callbacks, fmi2False, fmi2False);
    set_texts(c, settings);
    fmi2SetBoolean(c, &resume, 1, &resumes);
    if (settings & 64) {
        fmi2SetReal(c, limits, 6, bounds);
    }
    fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    fmi2EnterInitializationMode(c);
    fmi2GetReal(c, &output, 1, &y);
    fmi2ExitInitializationMode(c);
    for (k = 0; k < 12; k++) {
        fmi2Real command = 0.75 * k;
        fmi2SetReal(c, &force, 1, &command);
        fmi2DoStep(c, 0.5 * k, 0.5, fmi2True);
        check((const Slave *)c);
    }
    if (settings & 16) {
        fmi2Reset(c);
    }
    fmi2FreeInstance(c);
    return 0;
}
