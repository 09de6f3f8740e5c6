/* The slave of xcp.h at a UDP port, for POSIX systems. It waits for nothing: call it between steps.
 *
 * XCP has no key, so whoever can send to the port measures and calibrates. Another master takes part
 * once it connects.
 */
#ifndef XCP_UDP_H
#define XCP_UDP_H

#include <arpa/inet.h>
#include <stdio.h>
#include <sys/socket.h>

#include "xcp.h"

enum { XCP_COMMANDS_AT_ONCE = 16 };

typedef struct {
    xcp slave;
    int network;
    struct sockaddr_in master;
} xcp_server;

/* Listen at an IPv4 address, at a port of it, 0 for any; false, with a line, where that fails. */
static inline bool xcp_listen(xcp_server *s, const char *address, uint16_t port)
{
    struct sockaddr_in at;
    socklen_t length = sizeof at;
    memset(&at, 0, sizeof at);
    at.sin_family = AF_INET;
    at.sin_port = htons(port);
    s->network = socket(AF_INET, SOCK_DGRAM, 0);
    if (s->network < 0 || inet_pton(AF_INET, address, &at.sin_addr) != 1 ||
            bind(s->network, (struct sockaddr *)&at, length) ||
            getsockname(s->network, (struct sockaddr *)&at, &length)) {
        perror(address);
        return false;
    }
    printf("XCP at %s:%u, without a key: whoever can send there may calibrate\n", address,
            (unsigned)ntohs(at.sin_port));
    fflush(stdout);
    return true;
}

/* One that cannot be sent is one that is lost, which the master sees by the counter. */
static inline void xcp_to_master(void *server, const uint8_t *datagram, size_t size)
{
    const xcp_server *s = (const xcp_server *)server;
    (void)sendto(s->network, datagram, size, MSG_DONTWAIT, (const struct sockaddr *)&s->master,
            sizeof s->master);
}

/* Do the commands that have come, so many at most. */
static inline void xcp_do_commands(xcp_server *s, uint32_t now)
{
    uint8_t datagram[XCP_ANSWER_SIZE], answer[XCP_ANSWER_SIZE];
    int most;
    for (most = XCP_COMMANDS_AT_ONCE; most > 0; most--) {
        struct sockaddr_in from;
        socklen_t length = sizeof from;
        ssize_t n = recvfrom(s->network, datagram, sizeof datagram, MSG_DONTWAIT,
                (struct sockaddr *)&from, &length);
        size_t size;
        if (n < 0)
            return;
        if (xcp_is_connect(datagram, (size_t)n))
            s->master = from;
        else if (from.sin_port != s->master.sin_port ||
                from.sin_addr.s_addr != s->master.sin_addr.s_addr)
            continue;
        size = xcp_receive(&s->slave, datagram, (size_t)n, now, answer);
        if (size)
            xcp_to_master(s, answer, size);
    }
}

#endif
