/* The hot loop in C: the same as run() of loop.py, which says what each part means.
 *
 * It makes the calls of a plan by their addresses, without Python's lock unless a callback takes it
 * (see engine.py, which builds and loads this file). The names in capitals that are not defined
 * here are the numbers of loop.py and fmi/instance.py, handed over as -DNAME=NUMBER.
 */

#define _POSIX_C_SOURCE 200809L /* clock_gettime */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

typedef struct {
    int64_t kind, first, last, period, phase;
} Operation;

typedef struct {
    int64_t source, target;
    double factor, offset;
} Connection;

typedef struct {
    int64_t buffer, index, slot;
} Cast;

typedef struct {
    int64_t element; /* its type: FLOAT32, ... */
    void *data;
} Buffer;

typedef struct { /* of drive.py; row is the last one until now */
    int64_t slot, linear, rows, row;
    const int64_t *times;
    const double *samples;
} Drive;

typedef struct { /* the columns of loop.py */
    double slot, relation, value, factor, offset, armed, held;
} Watch;

typedef struct { /* the columns of loop.py */
    double held_force, position, force, received, energy, period, scale;
    double force_factor, force_offset, position_factor, position_offset;
    double last_position, last_force, last_received;
} Exchange;

typedef struct { /* of fmi/instance.py, Native */
    int64_t shape;
    void (*function)(void);
    void *instance;
    const uint32_t *references;
    int64_t size;
    void *data;
    double step;
    uint8_t *flags;
    double *last;
    int64_t values; /* of all references, where some are of arrays */
    double *limit;  /* s, before which a step must end that is taken at once */
} Call;

typedef struct {
    const Operation *operations;
    int64_t size;
    const Connection *connections;
    const Cast *casts;
    const Buffer *buffers;
    Drive *drives;
    Watch *watches;
    Exchange *exchanges;
    const Call *calls;
    double *values;
    int64_t width;
    double *clock;
    double *warned; /* of each call, how many warnings it returned, and the time of the first */
    const int64_t *bounds; /* of exchange/bounds.py: of the first values, the bits of a magnitude */
    int64_t bounded;
    int64_t *exceeded; /* not 0 once a value has come to its bound */
} Plan;

typedef struct { /* of system/times.py, in counts: point k is at start + k * step */
    int64_t start, step;
    double per_second;
} TimeGrid;

typedef struct { /* what the loop and others tell each other while it runs */
    int64_t operation, status; /* why it ended; 0, 0 at the end */
    int64_t done;              /* steps whose rows are there */
    int64_t taken;             /* steps whose rows have been taken, so that others may take their places */
    int64_t halt;              /* not 0: end before the next step that has to be waited for */
    int64_t ended;             /* when it ended, by the monotonic clock in ns */
} Shared;

typedef struct { /* of realtime/pacer.py; times in ns */
    int64_t origin, base, base_step; /* base_step < 0: the first step is still to come */
    int64_t numerator, denominator;  /* the period */
    int64_t spin, slept, breath;     /* breath 0: no need to sleep for the sake of others */
    int64_t shifts, stops;           /* what a late step does to the schedule */
    int64_t arrived, late;
    int64_t tolerance;               /* by which a step may be late where that stops the run */
    int64_t stall;                   /* by which one may be at all; 0: whatever it is */
} Pace;

typedef int Python(void);
typedef int Transfer2(void *, const uint32_t *, size_t, void *);
typedef int Transfer3(void *, const uint32_t *, size_t, void *, size_t);
typedef int Step2(void *, double, double, int);
typedef int Step3(void *, double, double, bool, void *, void *, void *, double *);

static int64_t monotonic(void) {
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* Sleep until a time; a signal ends that early. */
static void sleep_until(int64_t time) {
    struct timespec until;

    until.tv_sec = (time_t)(time / 1000000000);
    until.tv_nsec = (long)(time % 1000000000);
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

/* Wait for the beginning of a step, as Pacer.__call__(); head gets its times. */
static int pace(Pace *p, int64_t step, double *head, const volatile int64_t *halt) {
    int64_t now = monotonic() - p->origin, due;

    p->arrived = now;
    if (p->base_step < 0) {
        p->base = p->slept = now;
        p->base_step = step;
    }
    due = p->base + (step - p->base_step) * p->numerator / p->denominator;
    p->late = now - due;
    if (p->late > p->tolerance && p->stops) return OVERRUN;
    if (p->stall && p->late > p->stall) return STALLED;
    if (p->late > 0 && p->shifts) {
        p->base = due = now;
        p->base_step = step;
    }
    while (now + p->spin < due) {
        int64_t until = due - p->spin < now + SLICE ? due - p->spin : now + SLICE;
        if (*halt) return HALTED;
        sleep_until(p->origin + until);
        p->slept = now = monotonic() - p->origin;
    }
    if (p->breath && now - p->slept > p->breath) {
        sleep_until(p->origin + now + NAP);
        p->slept = now = monotonic() - p->origin;
    }
    while (now < due) now = monotonic() - p->origin;
    if (*halt) return HALTED;
    head[ARRIVED] = (double)p->arrived;
    head[LATE] = (double)p->late;
    head[SCHEDULED] = (double)due;
    head[BEGIN] = (double)now;
    return 0;
}

/* Make a call; its FMI status. clock: the time of the step, its number, its end. */
static int invoke(const Call *call, const double *clock, const Shared *shared) {
    double time = clock[0];
    uint8_t *said = call->flags;
    int status;

    switch (call->shape) {
    case TRANSFER_2:
        return ((Transfer2 *)call->function)(call->instance, call->references, (size_t)call->size,
                                             call->data);
    case STEP_2:
        return ((Step2 *)call->function)(call->instance, time, call->step, 1);
    case TRANSFER_3:
        return ((Transfer3 *)call->function)(call->instance, call->references, (size_t)call->size,
                                             call->data, (size_t)call->values);
    case STEP_3:
        if (clock[2] >= *call->limit) return DUE;
        status = ((Step3 *)call->function)(call->instance, time, call->step, true, said, said + 1,
                                           said + 2, call->last);
        if (status > WORST) return status;
        if (said[0] && !said[1]) return EVENT;
        return said[1] || said[2] ? EARLY : status;
    case READ:
        memcpy(call->data, call->instance, (size_t)call->size * sizeof(double));
        return 0;
    case CLOCK:
        *(double *)call->data = (double)(monotonic() - call->size);
        return 0;
    case PACE:
        return pace(call->instance, (int64_t)clock[1], call->data, &shared->halt);
    default:
        return ((Python *)call->function)();
    }
}

/* An element of a buffer as a double; of a Boolean any byte but 0 is true. */
static double load(const Buffer *buffer, int64_t i) {
    switch (buffer->element) {
    case FLOAT32: return (double)((const float *)buffer->data)[i];
    case BOOL: return ((const uint8_t *)buffer->data)[i] ? 1.0 : 0.0;
    case INT8: return (double)((const int8_t *)buffer->data)[i];
    case UINT8: return (double)((const uint8_t *)buffer->data)[i];
    case INT16: return (double)((const int16_t *)buffer->data)[i];
    case UINT16: return (double)((const uint16_t *)buffer->data)[i];
    case INT32: return (double)((const int32_t *)buffer->data)[i];
    case UINT32: return (double)((const uint32_t *)buffer->data)[i];
    case INT64: return (double)((const int64_t *)buffer->data)[i];
    default: return (double)((const uint64_t *)buffer->data)[i];
    }
}

/* Put a number into a buffer, in its type. */
static void store(const Buffer *buffer, int64_t i, double value) {
    switch (buffer->element) {
    case FLOAT32: ((float *)buffer->data)[i] = (float)value; break;
    case BOOL: ((uint8_t *)buffer->data)[i] = value >= 1.0 || value <= -1.0; break;
    case INT8: ((int8_t *)buffer->data)[i] = (int8_t)value; break;
    case UINT8: ((uint8_t *)buffer->data)[i] = (uint8_t)value; break;
    case INT16: ((int16_t *)buffer->data)[i] = (int16_t)value; break;
    case UINT16: ((uint16_t *)buffer->data)[i] = (uint16_t)value; break;
    case INT32: ((int32_t *)buffer->data)[i] = (int32_t)value; break;
    case UINT32: ((uint32_t *)buffer->data)[i] = (uint32_t)value; break;
    case INT64: ((int64_t *)buffer->data)[i] = (int64_t)value; break;
    default: ((uint64_t *)buffer->data)[i] = (uint64_t)value; break;
    }
}

/* The value at a time in counts, which is not before that of the last call. */
static double drive(Drive *d, int64_t time) {
    const int64_t *times = d->times;
    const double *samples = d->samples;
    int64_t row = d->row;
    double share;

    while (row + 1 < d->rows && times[row + 1] <= time) row++;
    d->row = row;
    if (!d->linear || time <= times[row] || row + 1 == d->rows) return samples[row];
    share = (double)(times[row + 1] - time) / (double)(times[row + 1] - times[row]);
    return share * samples[row] + (1.0 - share) * samples[row + 1];
}

/* Count it where the condition of a watch holds; 1 where it is armed, which it is no more. */
static int holds(Watch *w, const double *values) {
    double signal = values[(int64_t)w->slot];
    int is;

    if (w->factor != 1.0 || w->offset != 0.0) signal = w->factor * signal + w->offset;
    switch ((int)w->relation) { /* in the order of the relations in system/parts.py */
    case 0: is = signal < w->value; break;
    case 1: is = signal <= w->value; break;
    case 2: is = signal > w->value; break;
    case 3: is = signal >= w->value; break;
    case 4: is = signal == w->value; break;
    default: is = signal != w->value; break;
    }
    if (!is) return 0;
    is = w->armed != 0.0;
    w->armed = 0.0;
    w->held += 1.0;
    return is;
}

/* Add what an exchange has created by the end of a step, as account() of loop.py. */
static void account(Exchange *e, double *values, int64_t step) {
    double position = values[(int64_t)e->position];
    double earned = values[(int64_t)e->held_force] * (position - e->last_position);

    e->last_position = position;
    if (e->period == 1.0 || step % (int64_t)e->period == 0) { /* a division takes 20 cycles */
        double force = e->force_factor * values[(int64_t)e->force] + e->force_offset;
        double received = values[(int64_t)e->received] - e->position_offset;
        received = received / e->position_factor;
        earned += -0.5 * (force + e->last_force) * (received - e->last_received);
        e->last_force = force;
        e->last_received = received;
    }
    values[(int64_t)e->energy] += e->scale * earned;
}

/* Write the row of a step, and tell whether a value has come to its bound. */
static void write_row(const Plan *plan, double *row) {
    int64_t i, bits, exceeded = 0;

    memcpy(row, plan->values, (size_t)plan->width * sizeof(double));
    for (i = 0; i < plan->bounded; i++) { /* as integers, magnitudes have the order that they have */
        memcpy(&bits, &plan->values[i], sizeof bits);
        exceeded |= (bits & INT64_MAX) >= plan->bounds[i];
    }
    if (exceeded) *plan->exceeded = 1;
}

/* The communication point k in s. */
static double point(const TimeGrid *grid, int64_t k) {
    return (double)(grid->start + k * grid->step) / grid->per_second;
}

/* Count a warning; of the first one the time of the step is kept. */
static void note_warning(double *warned, double time) {
    if (!warned[0]) warned[1] = time;
    warned[0] += 1.0;
}

/* Do one operation in step k, which begins at a time in s; 0, or the status that ends the loop. */
static int operate(const Plan *plan, const Operation *operation, int64_t k, double time,
                   const TimeGrid *grid, const Shared *shared) {
    double *values = plan->values;
    int64_t i, begin = operation->first, end = operation->last;

    switch (operation->kind) {
    case STEP:
        plan->clock[0] = operation->period == 1 ? time : point(grid, k + 1 - operation->period);
        /* fall through */
    case CALL: {
        int status = invoke(&plan->calls[begin], plan->clock, shared);
        if (status > WORST) return status;
        if (status) note_warning(plan->warned + 2 * begin, plan->clock[0]);
        return 0;
    }
    case COPY:
        for (i = begin; i < end; i++) {
            const Connection *c = &plan->connections[i];
            values[c->target] = values[c->source];
        }
        return 0;
    case SCALE:
        for (i = begin; i < end; i++) {
            const Connection *c = &plan->connections[i];
            values[c->target] = c->factor * values[c->source] + c->offset;
        }
        return 0;
    case STORE:
        for (i = begin; i < end; i++) {
            const Cast *c = &plan->casts[i];
            store(&plan->buffers[c->buffer], c->index, values[c->slot]);
        }
        return 0;
    case DRIVE:
        for (i = begin; i < end; i++) {
            Drive *d = &plan->drives[i];
            values[d->slot] = drive(d, grid->start + (k - operation->phase) * grid->step);
        }
        return 0;
    case WATCH: return holds(&plan->watches[begin], values) ? WATCHED : 0;
    case EXCHANGE:
        for (i = begin; i < end; i++) account(&plan->exchanges[i], values, k + 1);
        return 0;
    default: /* LOAD and LOAD_LONG */
        for (i = begin; i < end; i++) {
            const Cast *c = &plan->casts[i];
            double value = load(&plan->buffers[c->buffer], c->index);
            if (operation->kind == LOAD_LONG && (value >= EXACT || value <= -EXACT))
                return TOO_LONG;
            values[c->slot] = value;
        }
        return 0;
    }
}

/* rows has room for so many, of which the first step takes the given one; then it begins again. */
int64_t run(const Plan *plan, double *rows, int64_t room, int64_t row, int64_t operation,
            int64_t start, int64_t stop, int64_t grid_start, int64_t grid_step,
            int64_t per_second, Shared *shared) {
    const TimeGrid grid = {grid_start, grid_step, (double)per_second};
    double time, end = point(&grid, start);
    int64_t k;

    shared->operation = shared->status = 0;
    for (k = start; k < stop; k++) {
        time = end;
        end = point(&grid, k + 1);
        plan->clock[1] = (double)k;
        plan->clock[2] = end;
        if (k - __atomic_load_n(&shared->taken, __ATOMIC_ACQUIRE) >= room) {
            shared->operation = operation;
            shared->status = FULL;
            return k;
        }
        for (; operation < plan->size; operation++) {
            const Operation *o = &plan->operations[operation];
            if (o->period == 1 || k % o->period == o->phase) {
                int status = operate(plan, o, k, time, &grid, shared);
                if (status) {
                    shared->operation = operation;
                    shared->status = status;
                    return k;
                }
            }
        }
        operation = 0;
        write_row(plan, rows + row * plan->width);
        if (++row == room) row = 0;
        __atomic_store_n(&shared->done, k + 1, __ATOMIC_RELEASE);
    }
    shared->ended = monotonic();
    return stop;
}
