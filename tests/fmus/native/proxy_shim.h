/* In front of the sources of a proxy: its clock is that of a test, which also sees what it sends and
   when it looks up a name, and may have either fail. */
#define _GNU_SOURCE
#include <errno.h>
#include <netdb.h>
#include <stdint.h>
#include <sys/socket.h>
#include <time.h>

#define SHIM_EXPORT __attribute__((visibility("default")))

SHIM_EXPORT int64_t (*shim_clock)(void); /* ns */
SHIM_EXPORT int (*shim_send)(const void *datagram, size_t size); /* 0, or why it is not sent */
SHIM_EXPORT int (*shim_look_up)(void); /* 0, or what getaddrinfo() returns for a name */

static int shim_getaddrinfo(const char *host, const char *service, const struct addrinfo *how,
                            struct addrinfo **found)
{
    int error = how->ai_flags & AI_NUMERICHOST ? 0 : shim_look_up();
    return error ? error : getaddrinfo(host, service, how, found);
}

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
#define getaddrinfo shim_getaddrinfo
