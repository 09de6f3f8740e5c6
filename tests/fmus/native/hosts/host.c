/* A host for FMI 2.0 and 3.0, on Linux and Windows, that does what a script says:

     host SCRIPT ANSWERS [SCRIPT ANSWERS ...]      each pair in a thread of its own

   A line of a script is a command, its words parted by tabs; "-" is NULL. Each is answered by its
   name, a status, and what it found; what the FMU logs comes before. Numbers are 16 hexadecimal
   digits, the bits of the double: no locale and no rounding comes between.

     load L FMI PATH                          unload L
     new I L CALLBACKS NAME TOKEN RESOURCES   CALLBACKS: full, own (memory of the host)
     init I START   leave I   terminate I   reset I   free I
     set I KIND VR VALUE    get I KIND VR...  KIND: real, boolean, integer
     step I TIME H          last I            the time it came to, of FMI 2.0
     save I S   restore I S   forget I S      S: a place for a state; bytes are hexadecimal, too
     bytes I S  from I S BYTES
     connect I VR J VR      record I KIND VR  an input and its output; what `row` and `loop` write
     feed I                                   its connected inputs
     rows PATH              row               the recorded values as doubles
     loop K N H             N steps from K*H: in order, each is fed, then steps; then a row
     locale NAME            memory            calls of allocation so far, the host's own included
   The loop ends with the first status that is neither OK nor Warning. */
#include <locale.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
typedef HMODULE Module;
#else
#include <dlfcn.h>
#include <pthread.h>
typedef void *Module;
#endif

#include "fmi2Functions.h"
#include "fmi3Functions.h"

enum { MOST = 64, WORDS = 512, LINE = 65536, MISSING = 99 };

#define FMI2_FUNCTIONS(F)                                                                          \
    F(Instantiate) F(FreeInstance) F(SetupExperiment) F(EnterInitializationMode)                   \
    F(ExitInitializationMode) F(Terminate) F(Reset) F(SetReal) F(GetReal) F(SetBoolean)            \
    F(GetBoolean) F(SetInteger) F(GetInteger) F(DoStep) F(GetFMUstate) F(SetFMUstate)              \
    F(FreeFMUstate) F(SerializedFMUstateSize) F(SerializeFMUstate) F(DeSerializeFMUstate)          \
    F(GetRealStatus)
#define FMI3_FUNCTIONS(F)                                                                          \
    F(InstantiateCoSimulation) F(FreeInstance) F(EnterInitializationMode)                          \
    F(ExitInitializationMode) F(Terminate) F(Reset) F(SetFloat64) F(GetFloat64) F(SetBoolean)      \
    F(GetBoolean) F(SetInt32) F(GetInt32) F(SetInt64) F(GetInt64) F(DoStep) F(GetFMUState)         \
    F(SetFMUState) F(FreeFMUState) F(SerializedFMUStateSize) F(SerializeFMUState)                  \
    F(DeserializeFMUState)

typedef struct {
    Module module;
    int fmi;
#define DECLARE(name) fmi2##name##TYPE *two##name;
    FMI2_FUNCTIONS(DECLARE)
#undef DECLARE
#define DECLARE(name) fmi3##name##TYPE *three##name;
    FMI3_FUNCTIONS(DECLARE)
#undef DECLARE
} Library;

typedef struct {
    Library *l;
    void *component;
    fmi2CallbackFunctions callbacks;
    uint32_t fed[MOST], sources[MOST];
    int from[MOST], connections;
} Instance;

typedef struct {
    FILE *script, *answers, *rows;
    Library libraries[MOST];
    Instance instances[MOST];
    void *states[MOST];
    int most;  /* instances */
    int recorded, of[MOST * 4];
    char kinds[MOST * 4];
    uint32_t references[MOST * 4];
    char *words[WORDS];
    int count;
} Host;

static const char *const script_and_answers = "usage: host SCRIPT ANSWERS [SCRIPT ANSWERS ...]\n";

/* Memory */

#ifdef COUNT_ALLOCATIONS  /* glibc alone calls these in the place of its own, also from an FMU */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t n, size_t size);
void *__libc_realloc(void *memory, size_t size);
static volatile long allocations;
void *malloc(size_t size)
{
    allocations++;
    return __libc_malloc(size);
}
void *calloc(size_t n, size_t size)
{
    allocations++;
    return __libc_calloc(n, size);
}
void *realloc(void *memory, size_t size)
{
    allocations++;
    return __libc_realloc(memory, size);
}
#else
static const long allocations = 0;
#endif

static void *own_allocate(size_t n, size_t size)
{
    char *memory = (char *)calloc(1, n * size + 16);
    if (!memory) {
        return NULL;
    }
    memcpy(memory, "of the host", 12);
    return memory + 16;
}

static void own_free(void *memory)
{
    if (memory && memcmp((char *)memory - 16, "of the host", 12) != 0) {
        abort();
    }
    free(memory ? (char *)memory - 16 : NULL);
}

/* What the FMU says */

static void log_2(void *host, fmi2String name, fmi2Status status, fmi2String category,
                  fmi2String message, ...)
{
    va_list arguments;
    fprintf(((Host *)host)->answers, "log\t%d\t%s\t%s\t", (int)status, category, name);
    va_start(arguments, message);
    vfprintf(((Host *)host)->answers, message, arguments);
    va_end(arguments);
    fprintf(((Host *)host)->answers, "\n");
}

static void log_3(void *host, fmi3Status status, fmi3String category, fmi3String message)
{
    fprintf(((Host *)host)->answers, "log\t%d\t%s\t\t%s\n", (int)status, category, message);
}

/* Words */

static int digit(char c)
{
    return c <= '9' ? c - '0' : c - 'a' + 10;
}

static double number(const char *word)
{
    uint64_t bits = 0;
    double v;
    for (; *word; word++) {
        bits = bits << 4 | (uint64_t)digit(*word);
    }
    memcpy(&v, &bits, sizeof v);
    return v;
}

static void put_number(Host *host, double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    fprintf(host->answers, "\t%08lx%08lx", (unsigned long)(bits >> 32),
            (unsigned long)(bits & 0xffffffffu));
}

static int place(const Host *host, int word)
{
    int i = word < host->count ? atoi(host->words[word]) : 0;
    return i >= 0 && i < MOST ? i : 0;
}

static const char *text(const Host *host, int word)
{
    return strcmp(host->words[word], "-") == 0 ? NULL : host->words[word];
}

static uint32_t reference(const char *word)
{
    return (uint32_t)strtoul(word, NULL, 10);
}

/* Libraries */

static void *symbol(Library *l, int fmi, const char *name)
{
    char whole[100];
    sprintf(whole, "fmi%d%s", fmi, name);
#ifdef _WIN32
    return (void *)(uintptr_t)GetProcAddress(l->module, whole);
#else
    return dlsym(l->module, whole);
#endif
}

static int load(Host *host)
{
    Library *l = &host->libraries[place(host, 1)];
    void *found;
    int all = 1;
    memset(l, 0, sizeof *l);
    l->fmi = atoi(host->words[2]);
#ifdef _WIN32
    l->module = LoadLibraryA(host->words[3]);
    if (!l->module) {
        fprintf(host->answers, "error %lu\n", GetLastError());
        return MISSING;
    }
#else
    l->module = dlopen(host->words[3], RTLD_NOW | RTLD_LOCAL);
    if (!l->module) {
        fprintf(host->answers, "%s\n", dlerror());
        return MISSING;
    }
#endif
#define FIND(fmi, name, variable)                                                                  \
    found = symbol(l, fmi, name);                                                                  \
    memcpy(&variable, &found, sizeof found);                                                       \
    all &= found != NULL;
    if (l->fmi == 2) {
#define FIND_2(name) FIND(2, #name, l->two##name)
        FMI2_FUNCTIONS(FIND_2)
    } else {
#define FIND_3(name) FIND(3, #name, l->three##name)
        FMI3_FUNCTIONS(FIND_3)
    }
    return all ? 0 : MISSING;
}

static int unload(Host *host)
{
    Library *l = &host->libraries[place(host, 1)];
    Module module = l->module;
    memset(l, 0, sizeof *l);
#ifdef _WIN32
    return FreeLibrary(module) ? 0 : MISSING;
#else
    return dlclose(module);
#endif
}

/* Instances */

static int make(Host *host)
{
    int i = place(host, 1);
    Instance *s = &host->instances[i];
    const char *name = text(host, 4), *token = text(host, 5), *resources = text(host, 6);
    int own = strcmp(host->words[3], "own") == 0;
    fmi2CallbackFunctions callbacks = {log_2, own ? own_allocate : calloc, own ? own_free : free,
                                       NULL, host};
    memset(s, 0, sizeof *s);
    memcpy(&s->callbacks, &callbacks, sizeof callbacks);  /* its members are const */
    s->l = &host->libraries[place(host, 2)];
    host->most = i >= host->most ? i + 1 : host->most;
    s->component = s->l->fmi == 2
                       ? s->l->twoInstantiate(name, fmi2CoSimulation, token, resources,
                                              &s->callbacks, fmi2False, fmi2False)
                       : s->l->threeInstantiateCoSimulation(name, token, resources, fmi3False,
                                                            fmi3False, fmi3False, fmi3False,
                                                            NULL, 0, host, log_3, NULL);
    return s->component ? 0 : MISSING;
}

static int initialise(Instance *s, double start)
{
    int status;
    if (s->l->fmi == 3) {
        return s->l->threeEnterInitializationMode(s->component, fmi3False, 0.0, start, fmi3False,
                                                  0.0);
    }
    status = s->l->twoSetupExperiment(s->component, fmi2False, 0.0, start, fmi2False, 0.0);
    return status ? status : (int)s->l->twoEnterInitializationMode(s->component);
}

static int release(Instance *s)
{
    if (s->l->fmi == 2) {
        s->l->twoFreeInstance(s->component);
    } else {
        s->l->threeFreeInstance(s->component);
    }
    s->component = NULL;
    return 0;
}

static int set_value(Instance *s, char kind, uint32_t vr, double v)
{
    fmi2Boolean boolean_2 = v != 0.0;
    fmi3Boolean boolean_3 = v != 0.0;
    fmi2Integer integer = (fmi2Integer)v;
    if (s->l->fmi == 2) {
        return kind == 'r'   ? s->l->twoSetReal(s->component, &vr, 1, &v)
               : kind == 'b' ? s->l->twoSetBoolean(s->component, &vr, 1, &boolean_2)
                             : s->l->twoSetInteger(s->component, &vr, 1, &integer);
    }
    return kind == 'r'   ? s->l->threeSetFloat64(s->component, &vr, 1, &v, 1)
           : kind == 'b' ? s->l->threeSetBoolean(s->component, &vr, 1, &boolean_3, 1)
                         : s->l->threeSetInt32(s->component, &vr, 1, &integer, 1);
}

static int get_value(Instance *s, char kind, uint32_t vr, double *v)
{
    fmi2Boolean boolean_2 = 0;
    fmi3Boolean boolean_3 = 0;
    fmi2Integer integer = 0;
    int status;
    if (kind == 'r') {
        return s->l->fmi == 2 ? (int)s->l->twoGetReal(s->component, &vr, 1, v)
                              : (int)s->l->threeGetFloat64(s->component, &vr, 1, v, 1);
    }
    if (kind == 'b') {
        status = s->l->fmi == 2
                     ? (int)s->l->twoGetBoolean(s->component, &vr, 1, &boolean_2)
                     : (int)s->l->threeGetBoolean(s->component, &vr, 1, &boolean_3, 1);
        *v = boolean_2 || boolean_3;
        return status;
    }
    status = s->l->fmi == 2 ? (int)s->l->twoGetInteger(s->component, &vr, 1, &integer)
                            : (int)s->l->threeGetInt32(s->component, &vr, 1, &integer, 1);
    *v = integer;
    return status;
}

static int get_values(Host *host, Instance *s)
{
    double values[WORDS];
    int i, status = 0;
    for (i = 3; i < host->count && status == 0; i++) {
        status = get_value(s, host->words[2][0], reference(host->words[i]), &values[i]);
    }
    fprintf(host->answers, "get\t%d", status);
    for (i = 3; i < host->count && status == 0; i++) {
        put_number(host, values[i]);
    }
    fprintf(host->answers, "\n");
    return status;
}

/* One call sets all its connected inputs, as masters do */
static int feed(Host *host, Instance *s)
{
    double values[MOST];
    int i, status = 0;
    for (i = 0; i < s->connections && status == 0; i++) {
        status = get_value(&host->instances[s->from[i]], 'r', s->sources[i], &values[i]);
    }
    if (status || s->connections == 0) {
        return status;
    }
    return s->l->fmi == 2 ? (int)s->l->twoSetReal(s->component, s->fed, (size_t)s->connections,
                                               values)
                          : (int)s->l->threeSetFloat64(s->component, s->fed,
                                                       (size_t)s->connections, values,
                                                       (size_t)s->connections);
}

static int step(Instance *s, double time, double h)
{
    fmi3Boolean event = 0, end = 0, early = 0;
    fmi3Float64 last = 0.0;
    return s->l->fmi == 2
               ? (int)s->l->twoDoStep(s->component, time, h, fmi2False)
               : (int)s->l->threeDoStep(s->component, time, h, fmi3False, &event, &end, &early,
                                        &last);
}

/* States */

static int save(Instance *s, void **state)
{
    return s->l->fmi == 2 ? (int)s->l->twoGetFMUstate(s->component, state)
                          : (int)s->l->threeGetFMUState(s->component, state);
}

static int restore(Instance *s, void *state)
{
    return s->l->fmi == 2 ? (int)s->l->twoSetFMUstate(s->component, state)
                          : (int)s->l->threeSetFMUState(s->component, state);
}

static int forget(Instance *s, void **state)
{
    return s->l->fmi == 2 ? (int)s->l->twoFreeFMUstate(s->component, state)
                          : (int)s->l->threeFreeFMUState(s->component, state);
}

static int put_bytes(Host *host, Instance *s, void *state)
{
    static const char digits[] = "0123456789abcdef";
    unsigned char bytes[4096];
    size_t size = 0, i;
    int status = s->l->fmi == 2
                     ? (int)s->l->twoSerializedFMUstateSize(s->component, state, &size)
                     : (int)s->l->threeSerializedFMUStateSize(s->component, state, &size);
    if (status || size > sizeof bytes) {
        return status ? status : MISSING;
    }
    status = s->l->fmi == 2
                 ? (int)s->l->twoSerializeFMUstate(s->component, state, (fmi2Byte *)bytes, size)
                 : (int)s->l->threeSerializeFMUState(s->component, state, bytes, size);
    fprintf(host->answers, "bytes\t%d\t", status);
    for (i = 0; i < size && status == 0; i++) {
        fprintf(host->answers, "%c%c", digits[bytes[i] >> 4], digits[bytes[i] & 15]);
    }
    fprintf(host->answers, "\n");
    return status;
}

static int from_bytes(Instance *s, const char *word, void **state)
{
    unsigned char bytes[4096];
    size_t size = strlen(word) / 2, i;
    if (size > sizeof bytes) {
        return MISSING;
    }
    for (i = 0; i < size; i++) {
        bytes[i] = (unsigned char)(digit(word[2 * i]) << 4 | digit(word[2 * i + 1]));
    }
    *state = NULL;
    return s->l->fmi == 2
               ? (int)s->l->twoDeSerializeFMUstate(s->component, (fmi2Byte *)bytes, size, state)
               : (int)s->l->threeDeserializeFMUState(s->component, bytes, size, state);
}

/* The closed loop */

static int row(Host *host)
{
    double values[MOST * 4];
    int i, status = 0;
    for (i = 0; i < host->recorded && status == 0; i++) {
        status = get_value(&host->instances[host->of[i]], host->kinds[i], host->references[i],
                           &values[i]);
    }
    if (status == 0) {
        fwrite(values, sizeof *values, (size_t)host->recorded, host->rows);
    }
    return status;
}

static int loop(Host *host, long first, long steps, double h)
{
    long k;
    int i, status = 0;
    for (k = first; k < first + steps && status < 2; k++) {
        for (i = 0; i < host->most && status < 2; i++) {
            if (host->instances[i].component) {
                status = feed(host, &host->instances[i]);
                status = status < 2 ? step(&host->instances[i], (double)k * h, h) : status;
            }
        }
        status = status < 2 ? row(host) : status;
    }
    return status;
}

static int join(Host *host, Instance *s)
{
    s->fed[s->connections] = reference(host->words[2]);
    s->from[s->connections] = place(host, 3);
    s->sources[s->connections++] = reference(host->words[4]);
    return 0;
}

static int record(Host *host)
{
    host->of[host->recorded] = place(host, 1);
    host->kinds[host->recorded] = host->words[2][0];
    host->references[host->recorded++] = reference(host->words[3]);
    return 0;
}

static int rows(Host *host)
{
    if (host->rows) {
        fclose(host->rows);
    }
    host->rows = fopen(host->words[1], "wb");
    return host->rows ? 0 : MISSING;
}

static int last_time(Host *host, Instance *s)
{
    double time = 0.0;
    int status = s->l->fmi == 2 ? (int)s->l->twoGetRealStatus(
                                      s->component, fmi2LastSuccessfulTime, &time)
                                : MISSING;
    fprintf(host->answers, "last\t%d", status);
    put_number(host, time);
    fprintf(host->answers, "\n");
    return status;
}

/* The script */

/* -1 where the command has answered by itself */
static int do_command(Host *host)
{
    const char *command = host->words[0];
    Instance *s = &host->instances[place(host, 1)];
    int state = place(host, 2), status;
#define IS(name) (strcmp(command, name) == 0)
    if (IS("load") || IS("unload")) {
        return IS("load") ? load(host) : unload(host);
    }
    if (IS("new")) {
        return make(host);
    }
    if (IS("connect") || IS("record") || IS("rows") || IS("row")) {
        return IS("connect") ? join(host, s) : IS("record") ? record(host)
               : IS("rows")  ? rows(host)
                             : row(host);
    }
    if (IS("loop")) {
        return loop(host, atol(host->words[1]), atol(host->words[2]), number(host->words[3]));
    }
    if (IS("locale")) {
        return setlocale(LC_ALL, host->words[1]) ? 0 : MISSING;
    }
    if (IS("memory")) {
        fprintf(host->answers, "memory\t0\t%ld\n", allocations);
        return -1;
    }
    if (!s->component) {
        return MISSING;
    }
    if (IS("get") || IS("bytes") || IS("last")) {
        status = IS("get")     ? get_values(host, s)
                 : IS("bytes") ? put_bytes(host, s, host->states[state])
                               : last_time(host, s);
        return status == MISSING ? MISSING : -1;
    }
    if (IS("init") || IS("feed") || IS("free")) {
        return IS("init") ? initialise(s, number(host->words[2]))
               : IS("feed") ? feed(host, s) : release(s);
    }
    if (IS("set")) {
        return set_value(s, host->words[2][0], reference(host->words[3]), number(host->words[4]));
    }
    if (IS("step")) {
        return step(s, number(host->words[2]), number(host->words[3]));
    }
    if (IS("save") || IS("restore") || IS("forget")) {
        return IS("save")      ? save(s, &host->states[state])
               : IS("restore") ? restore(s, host->states[state])
                               : forget(s, &host->states[state]);
    }
    if (IS("from")) {
        return from_bytes(s, host->words[3], &host->states[state]);
    }
    if (s->l->fmi == 2) {
        return IS("leave")       ? (int)s->l->twoExitInitializationMode(s->component)
               : IS("terminate") ? (int)s->l->twoTerminate(s->component)
               : IS("reset")     ? (int)s->l->twoReset(s->component)
                                 : MISSING;
    }
    return IS("leave")       ? (int)s->l->threeExitInitializationMode(s->component)
           : IS("terminate") ? (int)s->l->threeTerminate(s->component)
           : IS("reset")     ? (int)s->l->threeReset(s->component)
                             : MISSING;
}

static void split(Host *host, char *line)
{
    line[strcspn(line, "\r\n")] = '\0';
    host->count = 0;
    while (line && host->count < WORDS) {
        char *tab = strchr(line, '\t');
        if (tab) {
            *tab++ = '\0';
        }
        host->words[host->count++] = line;
        line = tab;
    }
}

static void follow(Host *host)
{
    char *line = (char *)calloc(1, LINE);
    while (fgets(line, LINE, host->script)) {
        int status;
        split(host, line);
        status = do_command(host);
        if (status >= 0) {
            fprintf(host->answers, "%s\t%d\n", host->words[0], status);
        }
        fflush(host->answers);  /* lose nothing, should the FMU end the process */
    }
    free(line);
    if (host->rows) {
        fclose(host->rows);
    }
    fclose(host->script);
    fclose(host->answers);
}

#ifdef _WIN32
static DWORD WINAPI run(LPVOID host)
{
    follow((Host *)host);
    return 0;
}
typedef HANDLE Thread;
#define START(thread, host) (*(thread) = CreateThread(NULL, 0, run, host, 0, NULL)) == NULL
#define JOIN(thread) WaitForSingleObject(thread, INFINITE)
#else
static void *run(void *host)
{
    follow((Host *)host);
    return NULL;
}
typedef pthread_t Thread;
#define START(thread, host) pthread_create(thread, NULL, run, host)
#define JOIN(thread) pthread_join(thread, NULL)
#endif

int main(int count, char **words)
{
    Thread threads[MOST];
    int n = (count - 1) / 2, i;
    Host *hosts = (Host *)calloc(n > 0 ? (size_t)n : 1, sizeof *hosts);
    if (n < 1 || n > MOST || count != 2 * n + 1 || !hosts) {
        fputs(script_and_answers, stderr);
        return 2;
    }
    for (i = 0; i < n; i++) {
        hosts[i].script = fopen(words[1 + 2 * i], "r");
        hosts[i].answers = fopen(words[2 + 2 * i], "w");
        if (!hosts[i].script || !hosts[i].answers) {
            fputs(script_and_answers, stderr);
            return 2;
        }
    }
    if (n == 1) {
        follow(&hosts[0]);
    } else {
        for (i = 0; i < n; i++) {
            if (START(&threads[i], &hosts[i])) {
                return 3;
            }
        }
        for (i = 0; i < n; i++) {
            JOIN(threads[i]);
        }
    }
    free(hosts);
    return 0;
}
