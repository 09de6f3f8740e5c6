/* In front of the sources of a proxy: its clock is that of a test, which also sees what it sends, and
   may have that fail. */
#define _GNU_SOURCE
#include <errno.h>
#include <stdint.h>
#include <sys/socket.h>
#include <time.h>

#define SHIM_EXPORT __attribute__((visibility("default")))

SHIM_EXPORT int64_t (*shim_clock)(void); /* ns */
SHIM_EXPORT int (*shim_send)(const void *datagram, size_t size); /* 0, or why it is not sent */

static int shim_clock_gettime(clockid_t clock, struct timespec *now)
{
    int64_t ns = shim_clock();
    (void)clock;
    now->tv_sec = (time_t)(ns / 1000000000);
    now->tv_nsec = (long)(ns % 1000000000);
    return 0;
}

static ssize_t shim_sent(int at, const void *datagram, size_t size, int flags)
{
    errno = shim_send(datagram, size);
    return errno ? -1 : send(at, datagram, size, flags);
}

#define clock_gettime shim_clock_gettime
#define send shim_sent
