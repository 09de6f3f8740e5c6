/* Logs what it computes, y = time, where logging is on, and warns in steps that end after WARNS_AFTER.
 *
 * As OpenModelica's runtime it logs no warning before it was told the category. With DEAF it takes no
 * notice of categories: they switch all on. With MUTE it returns warnings without a message.
 */
#include <unistd.h>

enum { TIME, Y, TOLERANCE, LINES, VARIABLES };
#define STATES 0
#define OWN_STEPS
#define OWN bool talks, warns; int lines;
#ifndef WARNS_AFTER
#define WARNS_AFTER 1e9
#endif
#include "model.h"

static void start(Model *m) { m->talks = m->warns = m->logging; }

static void talk(Model *m, int status, const char *category, double number);

static void equations(Model *m) {
    *real(m, Y) = m->time;
    *real(m, TOLERANCE) = m->tolerance;
    m->v[LINES]->Int32 = m->lines;
    if (m->talks) talk(m, 0, "logEvents", m->time);
}

static void advance(Model *m, double end) {
    set_time(m, end);
    m->reason = NULL;
    if (end <= WARNS_AFTER) return;
    m->status = 1;
#ifndef MUTE
    if (m->warns) talk(m, 1, "logStatusWarning", end);
#endif
}

#include "fmi.c"

static void talk(Model *m, int status, const char *category, double number) {
#if FMI == 2
    const fmi2CallbackFunctions *host = m->host;
    host->logger(host->componentEnvironment, "somebody", (Status)status, category, "y is %g", number);
#else
    char text[64];
    snprintf(text, sizeof text, "y is %g", number);
    ((fmi3LogMessageCallback)m->log)(m->host, (Status)status, category, text);
#endif
    m->lines += status == 0;
}

Status F(SetDebugLogging)(void *c, Truth on, size_t n, const F(String) categories[]) {
    Model *m = c;
#ifdef DEAF
    (void)n; (void)categories;
    m->talks = m->warns = on;
#else
    m->talks = m->warns = on && !n;
    for (size_t i = 0; i < n; i++) {
        if (!strcmp(categories[i], "logEvents")) m->talks = on;
        if (!strcmp(categories[i], "logStatusWarning")) m->warns = on;
        if (!strcmp(categories[i], "logSecrets")) return fail(m, F(Error), "no secrets");
    }
#endif
    return F(OK);
}
