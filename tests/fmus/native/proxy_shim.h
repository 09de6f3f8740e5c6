/* In front of the sources of a proxy: its clock is that of a test. */
#define _GNU_SOURCE
#include <stdint.h>
#include <time.h>

#define SHIM_EXPORT __attribute__((visibility("default")))

SHIM_EXPORT int64_t (*shim_clock)(void); /* ns */

static int shim_clock_gettime(clockid_t clock, struct timespec *now)
{
    int64_t ns = shim_clock();
    (void)clock;
    now->tv_sec = (time_t)(ns / 1000000000);
    now->tv_nsec = (long)(ns % 1000000000);
    return 0;
}

#define clock_gettime shim_clock_gettime
