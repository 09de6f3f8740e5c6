/* One UDP socket to a peer, a clock, random bytes, a key file: BSD sockets or Winsock.

   Times are ns of a clock that never goes back. */
#ifndef SOCKETS_H
#define SOCKETS_H

#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32

#ifndef WIN32_LEAN_AND_MEAN
#define WIN32_LEAN_AND_MEAN
#endif
#ifndef NOUSER
#define NOUSER  /* its INPUT is another one */
#endif
#ifndef NOGDI
#define NOGDI
#endif
#include <winsock2.h>
#include <ws2tcpip.h>

#include <windows.h>
#ifdef _MSC_VER
#pragma comment(lib, "ws2_32.lib")
#endif

typedef SOCKET Socket;
typedef int NetLength;  /* of an address */
#define NO_SOCKET INVALID_SOCKET
#define net_yield() SwitchToThread()

#else

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

typedef int Socket;
typedef socklen_t NetLength;  /* of an address */
#define NO_SOCKET (-1)
#define net_yield() sched_yield()

#endif

#define NET_TEXT_SIZE 160
#define NET_SECOND INT64_C(1000000000)
#define NET_DESCRIPTORS 1024  /* those that select() can watch, but on Windows */
#define NET_HOST_SIZE 1024    /* bytes of a name or a path, with its NUL */

enum { NET_NOTHING = -1, NET_FAILED = -2 };  /* in the place of a size */

static void net_copy_text(char *to, const char *text)
{
    size_t n = strlen(text);
    n = n < NET_TEXT_SIZE ? n : NET_TEXT_SIZE - 1;
    memcpy(to, text, n);
    to[n] = '\0';
}

#ifdef _WIN32

static int64_t net_now(void)
{
    LARGE_INTEGER count, per_second;
    QueryPerformanceCounter(&count);
    QueryPerformanceFrequency(&per_second);
    return count.QuadPart / per_second.QuadPart * NET_SECOND
           + count.QuadPart % per_second.QuadPart * NET_SECOND / per_second.QuadPart;
}

static int net_random(void *bytes, size_t size)
{
    uint8_t *at = (uint8_t *)bytes;
    unsigned drawn;
    while (size > 0 && !rand_s(&drawn)) {
        *at++ = (uint8_t)drawn;
        size--;
    }
    return size == 0;
}

static int net_error(void)
{
    return WSAGetLastError();
}

/* Windows would say it in the language of the user */
static void net_error_text(int error, char *text)
{
    if (error == WSAENETUNREACH || error == WSAEHOSTUNREACH || error == WSAENETDOWN) {
        net_copy_text(text, "Network is unreachable");
    } else {
        sprintf(text, "Windows error %d", error);
    }
}

static int net_is_nothing(int error)
{
    return error == WSAEWOULDBLOCK;
}

/* That nobody listens, as an earlier datagram has shown */
static int net_is_refused(int error)
{
    return error == WSAECONNRESET || error == WSAECONNREFUSED;
}

static int net_begin(void)
{
    WSADATA data;
    return WSAStartup(MAKEWORD(2, 2), &data);
}

/* Between net_begin() and this there is one */
static void net_shut(Socket at)
{
    if (at != NO_SOCKET) {
        closesocket(at);
    }
    WSACleanup();
}

static int net_prepare(Socket at)
{
    u_long on = 1;
    return ioctlsocket(at, FIONBIO, &on);
}

/* The path is in UTF-8, which Windows does not know for files */
static FILE *net_file(const char *path)
{
    wchar_t wide[NET_HOST_SIZE];
    errno = ENOENT;
    return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, NET_HOST_SIZE) ? _wfopen(wide, L"rb")
                                                                          : NULL;
}

static int net_is_exposed(const char *path)
{
    (void)path;  /* nobody can tell */
    return 0;
}

/* Wait for a datagram, ns at most; what Windows rounds up to its ticks is waited for awake */
static int net_wait(Socket at, int64_t ns)
{
    const int64_t tick = 16000000;
    struct timeval most;
    fd_set sockets;
    ns = ns > tick ? ns - tick : 0;
    most.tv_sec = (long)(ns / NET_SECOND);
    most.tv_usec = (long)(ns % NET_SECOND / 1000);
    FD_ZERO(&sockets);
    FD_SET(at, &sockets);
    return select(0, &sockets, NULL, NULL, &most) > 0;
}

#else

static int64_t net_now(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * NET_SECOND + now.tv_nsec;
}

static int net_random(void *bytes, size_t size)
{
    FILE *file = fopen("/dev/urandom", "rb");
    size_t n = 0;
    if (file) {
        setvbuf(file, NULL, _IONBF, 0);
        n = fread(bytes, 1, size, file);
        fclose(file);
    }
    return n == size;
}

static int net_error(void)
{
    return errno;
}

static void net_error_text(int error, char *text)
{
    net_copy_text(text, strerror(error));
}

static int net_is_nothing(int error)
{
    return error == EAGAIN || error == EWOULDBLOCK || error == EINTR;
}

/* That nobody listens, as an earlier datagram has shown */
static int net_is_refused(int error)
{
    return error == ECONNREFUSED;
}

static int net_begin(void)
{
    return 0;
}

/* Between net_begin() and this there is one */
static void net_shut(Socket at)
{
    if (at != NO_SOCKET) {
        close(at);
    }
}

static int net_prepare(Socket at)
{
    if (at >= NET_DESCRIPTORS) {
        errno = EMFILE;
        return -1;
    }
    return fcntl(at, F_SETFD, FD_CLOEXEC) || fcntl(at, F_SETFL, O_NONBLOCK);
}

static FILE *net_file(const char *path)
{
    return fopen(path, "rb");
}

/* Whether others have rights to a file */
static int net_is_exposed(const char *path)
{
    struct stat file;
    return stat(path, &file) == 0 && (file.st_mode & 077);
}

/* Wait for a datagram, ns at most */
static int net_wait(Socket at, int64_t ns)
{
    struct timespec most;
    fd_set sockets;
    most.tv_sec = (time_t)(ns / NET_SECOND);
    most.tv_nsec = (long)(ns % NET_SECOND);
    FD_ZERO(&sockets);
    FD_SET(at, &sockets);
    return pselect(at + 1, &sockets, NULL, NULL, &most, NULL) > 0;
}

#endif

/* The address of a host: a name, or numbers, of IPv6 with brackets or without; of a name the one of IPv4,
   where it has one. Its size, or 0 with the reason in the text */
static NetLength net_address(const char *host, int port, struct sockaddr_storage *address, char *text)
{
    struct addrinfo how, *all, *found, *chosen;
    NetLength size = 0;
    char plain[NET_HOST_SIZE];
    size_t length = strlen(host);
    if (length > 2 && length < sizeof plain && host[0] == '[' && host[length - 1] == ']') {
        memcpy(plain, host + 1, length - 2);
        plain[length - 2] = '\0';
        host = plain;
    }
    memset(&how, 0, sizeof how);
    how.ai_family = AF_UNSPEC;
    how.ai_socktype = SOCK_DGRAM;
    if (getaddrinfo(host, NULL, &how, &all)) {
        net_copy_text(text, "no such host, or none with an address");
        return 0;
    }
    chosen = all;
    for (found = all; found; found = found->ai_next) {
        if (found->ai_family == AF_INET) {
            chosen = found;
            break;
        }
    }
    size = (NetLength)chosen->ai_addrlen;
    memcpy(address, chosen->ai_addr, (size_t)size);
    freeaddrinfo(all);
    if (address->ss_family == AF_INET) {
        ((struct sockaddr_in *)address)->sin_port = htons((uint16_t)port);
    } else {
        ((struct sockaddr_in6 *)address)->sin6_port = htons((uint16_t)port);
    }
    return size;
}

/* A socket that receives from the host alone and does not block; NO_SOCKET, with the reason in the text */
static Socket net_open(const char *host, int port, char *text)
{
    struct sockaddr_storage address;
    NetLength size;
    Socket at = NO_SOCKET;
    net_copy_text(text, "there is no network");
    if (net_begin()) {
        return NO_SOCKET;
    }
    size = net_address(host, port, &address, text);
    if (size > 0) {
        at = socket(address.ss_family, SOCK_DGRAM, 0);
        if (at != NO_SOCKET && !net_prepare(at)
            && !connect(at, (const struct sockaddr *)&address, size)) {
            return at;
        }
        net_error_text(net_error(), text);
    }
    net_shut(at);
    return NO_SOCKET;
}

/* 0 or the error */
static int net_send(Socket at, const uint8_t *datagram, size_t size)
{
    return send(at, (const char *)datagram, size, 0) < 0 ? net_error() : 0;
}

/* The size of a datagram that came, NET_NOTHING, or NET_FAILED with the error */
static long net_receive(Socket at, uint8_t *datagram, size_t size, int *error)
{
    long n = (long)recv(at, (char *)datagram, size, 0);
    *error = n < 0 ? net_error() : 0;
    return n >= 0 ? n : net_is_nothing(*error) ? NET_NOTHING : NET_FAILED;
}

/* Read a file of `size` bytes at most; its size, or -1 with the reason in the text */
static long net_read(const char *path, uint8_t *data, size_t size, char *text)
{
    FILE *file = net_file(path);
    long n = -1;
    if (file) {
        setvbuf(file, NULL, _IONBF, 0);
        n = (long)fread(data, 1, size, file);
        n = ferror(file) ? -1 : n;
    }
    if (n < 0) {
        net_copy_text(text, strerror(errno));
    }
    if (file) {
        fclose(file);
    }
    return n;
}

#endif
