/* One UDP socket to a peer, a clock, random bytes and the address of a name: BSD sockets or Winsock.

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
#define NO_SOCKET INVALID_SOCKET
typedef CRITICAL_SECTION NetLock;
typedef HANDLE NetThread;
#define net_lock_begin(lock) InitializeCriticalSection(lock)
#define net_lock(lock) EnterCriticalSection(lock)
#define net_unlock(lock) LeaveCriticalSection(lock)
#define net_lock_end(lock) DeleteCriticalSection(lock)

#else

#include <dlfcn.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

typedef int Socket;
#define NO_SOCKET (-1)
typedef pthread_mutex_t NetLock;
typedef pthread_t NetThread;
#define net_lock_begin(lock) pthread_mutex_init(lock, NULL)
#define net_lock(lock) pthread_mutex_lock(lock)
#define net_unlock(lock) pthread_mutex_unlock(lock)
#define net_lock_end(lock) pthread_mutex_destroy(lock)

#endif

#define NET_TEXT_SIZE 160
#define NET_SECOND INT64_C(1000000000)
#define NET_DESCRIPTORS 1024  /* those that select() can watch, but on Windows */
#define NET_HOST_SIZE 1024    /* bytes of a name or a path, with its NUL */

enum { NET_NOTHING = -1, NET_FAILED = -2 };  /* in the place of a size */

static const char net_here = 0;  /* what is in this library is near it */

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

static void net_pause(void)
{
    Sleep(1);
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
    const char *known = error == WSAENETUNREACH    ? "Network is unreachable"
                        : error == WSAEHOSTUNREACH ? "No route to host"
                        : error == WSAENETDOWN     ? "Network is down"
                        : error == WSAEACCES       ? "Permission denied" : NULL;
    if (known) {
        net_copy_text(text, known);
    } else {
        sprintf(text, "Windows error %d", error);
    }
}

static void net_lookup_text(int error, char *text)
{
    if (error == WSAHOST_NOT_FOUND || error == WSANO_DATA || error == WSATRY_AGAIN) {
        net_copy_text(text, "Name or service not known");
    } else {
        net_error_text(error, text);
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

static void net_end(void)
{
    WSACleanup();
}

static void net_close(Socket at)
{
    closesocket(at);
}

static int net_does_not_block(Socket at)
{
    u_long on = 1;
    return ioctlsocket(at, FIONBIO, &on);
}

/* The code of this library stays in memory: a thread that was abandoned is in it */
static void net_stay(void)
{
    HMODULE library;
    GetModuleHandleExA(GET_MODULE_HANDLE_EX_FLAG_PIN | GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS,
                       &net_here, &library);
}

#else

static int64_t net_now(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * NET_SECOND + now.tv_nsec;
}

static void net_pause(void)
{
    struct timespec pause = {0, 1000000};
    nanosleep(&pause, NULL);
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

static void net_lookup_text(int error, char *text)
{
    net_copy_text(text, gai_strerror(error));
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

static void net_end(void)
{
}

static void net_close(Socket at)
{
    close(at);
}

static int net_does_not_block(Socket at)
{
    return fcntl(at, F_SETFD, FD_CLOEXEC) || fcntl(at, F_SETFL, O_NONBLOCK);
}

/* The code of this library stays in memory: a thread that was abandoned is in it */
static void net_stay(void)
{
    Dl_info library;
    if (dladdr(&net_here, &library)) {
        (void)dlopen(library.dli_fname, RTLD_LAZY | RTLD_NOLOAD | RTLD_NODELETE);
    }
}

#endif

/* Names. There is no deadline to getaddrinfo(), so a thread calls it, and is left alone with it
   where it takes too long. */

typedef struct {
    NetLock lock;
    NetThread thread;
    int done, abandoned, error;
    char host[NET_HOST_SIZE];
    struct sockaddr_in address;
} NetLookup;

static int net_find(const char *host, int flags, struct sockaddr_in *address)
{
    struct addrinfo how, *found = NULL;
    int error;
    memset(&how, 0, sizeof how);
    how.ai_family = AF_INET;
    how.ai_socktype = SOCK_DGRAM;
    how.ai_flags = flags;
    error = getaddrinfo(host, NULL, &how, &found);
    if (!error) {
        memcpy(address, found->ai_addr, sizeof *address);
        freeaddrinfo(found);
    }
    return error;
}

static void net_free_lookup(NetLookup *lookup)
{
    net_lock_end(&lookup->lock);
    free(lookup);
}

static void net_look_up(NetLookup *lookup)
{
    int abandoned, error = net_find(lookup->host, 0, &lookup->address);
    net_lock(&lookup->lock);
    lookup->error = error;
    lookup->done = 1;
    abandoned = lookup->abandoned;
    net_unlock(&lookup->lock);
    if (abandoned) {
        net_free_lookup(lookup);
    }
}

#ifdef _WIN32

static DWORD WINAPI net_thread(LPVOID lookup)
{
    net_look_up((NetLookup *)lookup);
    net_end();
    return 0;
}

static int net_start_thread(NetLookup *lookup)
{
    if (net_begin()) {
        return 0;
    }
    lookup->thread = CreateThread(NULL, 0, net_thread, lookup, 0, NULL);
    if (!lookup->thread) {
        net_end();
    }
    return lookup->thread != NULL;
}

static void net_leave_thread(HANDLE thread)
{
    CloseHandle(thread);
}

static void net_join_thread(HANDLE thread)
{
    WaitForSingleObject(thread, INFINITE);
    CloseHandle(thread);
}

#else

static void *net_thread(void *lookup)
{
    net_look_up((NetLookup *)lookup);
    return NULL;
}

static int net_start_thread(NetLookup *lookup)
{
    return !pthread_create(&lookup->thread, NULL, net_thread, lookup);
}

static void net_leave_thread(pthread_t thread)
{
    pthread_detach(thread);
}

static void net_join_thread(pthread_t thread)
{
    pthread_join(thread, NULL);
}

#endif

/* Wait for a look-up in a thread, and for the end of that, as its code may be unloaded after this; 0
   where the deadline was first, and the thread has it now */
static int net_await(NetLookup *lookup, int64_t deadline)
{
    for (;;) {
        int done;
        NetThread thread = lookup->thread;
        net_lock(&lookup->lock);
        done = lookup->done;
        lookup->abandoned = !done && net_now() >= deadline;
        if (lookup->abandoned) {
            net_stay();
            net_leave_thread(thread);
            net_unlock(&lookup->lock);
            return 0;
        }
        net_unlock(&lookup->lock);
        if (done) {
            net_join_thread(thread);
            return 1;
        }
        net_pause();
    }
}

/* The address of a host, a name of less than NET_HOST_SIZE bytes, until the deadline; 0, and why not
   in the text. A number is one at once. */
static int net_address(const char *host, int64_t deadline, struct sockaddr_in *address, char *text)
{
    NetLookup *lookup;
    int error;
    if (!net_find(host, AI_NUMERICHOST, address)) {
        return 1;
    }
    lookup = (NetLookup *)calloc(1, sizeof *lookup);
    if (!lookup) {
        net_copy_text(text, "there is no memory");
        return 0;
    }
    net_lock_begin(&lookup->lock);
    strcpy(lookup->host, host);
    if (!net_start_thread(lookup)) {
        net_copy_text(text, "there is no thread to be had");
        net_free_lookup(lookup);
        return 0;
    }
    if (!net_await(lookup, deadline)) {
        net_copy_text(text, "its name was not resolved in time");
        return 0;
    }
    error = lookup->error;
    *address = lookup->address;
    net_free_lookup(lookup);
    if (error) {
        net_lookup_text(error, text);
    }
    return !error;
}

/* The socket. Between net_open() and net_shut() there is one. */

static void net_shut(Socket at)
{
    net_close(at);
    net_end();
}

/* A socket connected to the host, or NO_SOCKET, and why in the text */
static Socket net_open(const char *host, int port, int64_t deadline, char *text)
{
    struct sockaddr_in address;
    Socket at = NO_SOCKET;
    if (net_begin()) {
        net_copy_text(text, "there is no network");
        return NO_SOCKET;
    }
    if (net_address(host, deadline, &address, text)) {
        address.sin_port = htons((uint16_t)port);
        at = socket(AF_INET, SOCK_DGRAM, 0);
#ifndef _WIN32
        if (at >= NET_DESCRIPTORS) {
            net_copy_text(text, "the host has 1024 files open: must have fewer");
            net_shut(at);
            return NO_SOCKET;
        }
#endif
        if (at == NO_SOCKET || net_does_not_block(at)
            || connect(at, (const struct sockaddr *)&address, sizeof address)) {
            net_error_text(net_error(), text);
            if (at != NO_SOCKET) {
                net_close(at);
                at = NO_SOCKET;
            }
        }
    }
    if (at == NO_SOCKET) {
        net_end();
    }
    return at;
}

/* 0 or the error */
static int net_send(Socket at, const uint8_t *datagram, size_t size)
{
#ifdef _WIN32
    return send(at, (const char *)datagram, (int)size, 0) < 0 ? net_error() : 0;
#else
    return send(at, datagram, size, 0) < 0 ? net_error() : 0;
#endif
}

/* The size of a datagram that came, NET_NOTHING, or NET_FAILED with the error */
static long net_receive(Socket at, uint8_t *datagram, size_t size, int *error)
{
#ifdef _WIN32
    long n = recv(at, (char *)datagram, (int)size, 0);
#else
    long n = (long)recv(at, datagram, size, 0);
#endif
    *error = n < 0 ? net_error() : 0;
    return n >= 0 ? n : net_is_nothing(*error) ? NET_NOTHING : NET_FAILED;
}

/* Wait for a datagram, ns at most; what Windows rounds up to its ticks is waited for awake */
static int net_wait(Socket at, int64_t ns)
{
    fd_set sockets;
#ifdef _WIN32
    const int64_t tick = 16000000;
    struct timeval most;
    if (ns <= tick) {
        SwitchToThread();
        ns = 0;
    } else {
        ns -= tick;
    }
    most.tv_sec = (long)(ns / NET_SECOND);
    most.tv_usec = (long)(ns % NET_SECOND / 1000);
    FD_ZERO(&sockets);
    FD_SET(at, &sockets);
    return select(0, &sockets, NULL, NULL, &most) > 0;
#else
    struct timespec most;
    most.tv_sec = (time_t)(ns / NET_SECOND);
    most.tv_nsec = (long)(ns % NET_SECOND);
    FD_ZERO(&sockets);
    FD_SET(at, &sockets);
    return pselect(at + 1, &sockets, NULL, NULL, &most, NULL) > 0;
#endif
}

/* Key files */

/* The path is in UTF-8, which Windows does not know for files */
static FILE *net_file(const char *path)
{
#ifdef _WIN32
    wchar_t wide[NET_HOST_SIZE];
    errno = ENOENT;
    return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, NET_HOST_SIZE) ? _wfopen(wide, L"rb")
                                                                          : NULL;
#else
    return fopen(path, "rb");
#endif
}

/* Read a file of `size` bytes at most; its size, or -1 with the reason in the text */
static long net_read(const char *path, uint8_t *data, size_t size, char *text)
{
    FILE *file = net_file(path);
    size_t n;
    int error = errno;
    if (!file) {
        net_copy_text(text, strerror(error));
        return -1;
    }
    setvbuf(file, NULL, _IONBF, 0);
    errno = 0;
    n = fread(data, 1, size, file);
    error = ferror(file) ? errno : 0;
    fclose(file);
    if (error) {
        net_copy_text(text, strerror(error));
        return -1;
    }
    return (long)n;
}

/* The rights of others to a file, 0 where there are none or nobody can tell; else all of its mode */
static unsigned net_exposed(const char *path)
{
#ifdef _WIN32
    (void)path;
    return 0;
#else
    struct stat file;
    return stat(path, &file) == 0 && (file.st_mode & 077) ? (unsigned)file.st_mode & 07777 : 0;
#endif
}

#endif
