/* Measuring and calibrating by XCP: the slave's side of ASAM MCD-1 XCP 1.1, over UDP.
 *
 * No allocation, no globals, no system calls, no reads out of bounds whatever arrives. The program
 * that has the socket, the clock and the loop is yours, as in xcp_main.c:
 *
 *     between two steps, for each datagram that waits:
 *         n = xcp_receive(&slave, datagram, size, now, answer); send n bytes of answer, if any
 *     after each step:
 *         xcp_event(&slave, now, send, context), which sends what the master has asked for
 *
 * now is in us, of any clock; it may overflow. A value is taken where xcp_receive() is called, so it
 * is never halfway in a step: do not call it from an interrupt. XCP knows no key: whoever can send to
 * the port may read and calibrate. Only memory that the model gives is read, and only its parameters
 * are written, after its check.
 */
#ifndef XCP_H
#define XCP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "the A2L file has BYTE_ORDER MSB_LAST: must be a little-endian processor"
#endif

#ifndef XCP_LISTS
#define XCP_LISTS 4 /* DAQ lists at most; no more than 255 of each */
#endif
#ifndef XCP_ODTS
#define XCP_ODTS 16 /* messages of one event in all */
#endif
#ifndef XCP_ENTRIES
#define XCP_ENTRIES 128 /* pieces of memory in these in all */
#endif

enum {
    XCP_MAX_CTO = 64,  /* bytes of a command or its answer */
    XCP_MAX_DTO = 248, /* bytes of a message with measured values */
    XCP_HEAD_SIZE = 4, /* before each of them: their size, and a counter */
    XCP_STAMP_SIZE = 4,
    XCP_ANSWER_SIZE = XCP_HEAD_SIZE + XCP_MAX_CTO,
    XCP_MESSAGE_SIZE = XCP_HEAD_SIZE + XCP_MAX_DTO
};

/* The address of the texts, in the A2L file as ADDR_EPK, where no processor has memory */
#define XCP_TEXTS UINT32_C(0xFFFF0000)
#define XCP_EVENT_NAME "step"

/* What a command comes to: XCP_OK, or the code of an error */
enum {
    XCP_SYNCHRONISED = 0x00, /* the answer to SYNCH */
    XCP_DAQ_ACTIVE = 0x11,
    XCP_UNKNOWN = 0x20,
    XCP_SYNTAX = 0x21,
    XCP_OUT_OF_RANGE = 0x22,
    XCP_ACCESS_DENIED = 0x24,
    XCP_MODE_NOT_VALID = 0x27,
    XCP_SEQUENCE = 0x29,
    XCP_DAQ_CONFIG = 0x2A,
    XCP_MEMORY_OVERFLOW = 0x30,
    XCP_ERROR = 0xFE,
    XCP_OK = 0xFF
};

/* A parameter: where it begins, its bytes, and whether it may be set, and is 0 or 1 */
typedef struct {
    uint16_t offset;
    uint8_t size;
    bool is_tunable, is_boolean;
} xcp_parameter;

/* A piece of memory, and its address as the master has it */
typedef struct {
    uint32_t address;
    const uint8_t *bytes;
    uint32_t size;
} xcp_region;

/* Write bytes at an offset, or none of them: XCP_OK, or the code of an error */
typedef uint8_t (*xcp_write)(void *memory, uint32_t offset, const uint8_t *bytes, uint32_t size);

/* Send a datagram to the master */
typedef void (*xcp_send)(void *context, const uint8_t *datagram, size_t size);

typedef struct {
    const uint8_t *bytes;
    uint8_t size;
} xcp_entry;

/* So many of the entries, or of the ODTs, from one on */
typedef struct {
    uint8_t first, count;
} xcp_span;

/* A DAQ list: the ODTs that are sent at every prescaler-th event */
typedef struct {
    xcp_span odts;
    uint8_t prescaler, passed;
    bool selected, running;
} xcp_list;

typedef struct {
    const char *name; /* of the model */
    void *memory;
    xcp_write write;
    xcp_region readable[2]; /* the memory; then the texts: EPK and the event's name, each with its 0 */
    bool connected;
    uint32_t now;
    uint32_t mta; /* the memory transfer address */
    uint16_t counter;
    uint8_t allocated; /* by ALLOC_DAQ, then ALLOC_ODT, then ALLOC_ODT_ENTRY: 1, 2, 3; 0 none */
    uint8_t n_lists, n_odts, n_entries;
    xcp_span at; /* the entries that WRITE_DAQ goes on with */
    xcp_list lists[XCP_LISTS];
    xcp_span odts[XCP_ODTS];
    xcp_entry entries[XCP_ENTRIES];
    uint8_t message[XCP_MESSAGE_SIZE];
} xcp;

static inline uint16_t xcp_word(const uint8_t *at)
{
    return (uint16_t)(at[0] | at[1] << 8);
}

static inline uint32_t xcp_long(const uint8_t *at)
{
    return xcp_word(at) | (uint32_t)xcp_word(at + 2) << 16;
}

static inline void xcp_put(uint8_t *at, uint32_t value, int size)
{
    for (; size > 0; size--, value >>= 8)
        *at++ = (uint8_t)value;
}

/* Begin without a master. texts are the model's EPK, a 0, the event's name, a 0. */
static inline void xcp_init(xcp *x, const char *name, void *memory, uint32_t address, uint32_t size,
        xcp_write write, const char *texts, uint32_t texts_size)
{
    memset(x, 0, sizeof *x);
    x->name = name;
    x->memory = memory;
    x->write = write;
    x->readable[0].address = address;
    x->readable[0].bytes = (const uint8_t *)memory;
    x->readable[0].size = size;
    x->readable[1].address = XCP_TEXTS;
    x->readable[1].bytes = (const uint8_t *)texts;
    x->readable[1].size = texts_size;
}

/* What is at an address, if all of it may be read; else NULL */
static inline const uint8_t *xcp_find(const xcp *x, uint32_t address, uint32_t size)
{
    int i;
    for (i = 0; i < 2; i++) {
        const xcp_region *r = &x->readable[i];
        if (address >= r->address && size <= r->size && address - r->address <= r->size - size)
            return r->bytes + (address - r->address);
    }
    return NULL;
}

/* Whether bytes at an offset are whole parameters that may be set; XCP_OK, or the code of an error */
static inline uint8_t xcp_check_parameters(const xcp_parameter *p, size_t count, uint32_t offset,
        const uint8_t *bytes, uint32_t size)
{
    const uint32_t end = offset + size;
    uint32_t reached = 0;
    size_t i;
    for (i = 0; i < count && p[i].offset < end; i++) {
        if (p[i].offset < offset)
            continue;
        if (reached == 0 && p[i].offset > offset)
            return XCP_OUT_OF_RANGE; /* it would begin within one */
        if (!p[i].is_tunable)
            return XCP_ACCESS_DENIED;
        reached = p[i].offset + p[i].size;
        if (reached > end || (p[i].is_boolean && bytes[p[i].offset - offset] > 1))
            return XCP_OUT_OF_RANGE;
    }
    return reached == end ? XCP_OK : XCP_OUT_OF_RANGE;
}

static inline bool xcp_is_running(const xcp *x)
{
    int i;
    for (i = 0; i < x->n_lists; i++)
        if (x->lists[i].running)
            return true;
    return false;
}

static inline void xcp_stop(xcp *x)
{
    int i;
    for (i = 0; i < x->n_lists; i++)
        x->lists[i].running = x->lists[i].selected = false;
}

static inline void xcp_free(xcp *x)
{
    x->allocated = x->n_lists = x->n_odts = x->n_entries = x->at.count = 0;
    memset(x->lists, 0, sizeof x->lists);
    memset(x->odts, 0, sizeof x->odts);
    memset(x->entries, 0, sizeof x->entries);
}

/* A command, and its answer: so many bytes of it, of which the first is not for the handlers */
typedef struct {
    const uint8_t *c;
    size_t size;
    uint8_t *a;
    size_t n;
} xcp_call;

/* The DAQ list that a command is about, NULL where there is none */
static inline xcp_list *xcp_list_of(xcp *x, const xcp_call *call)
{
    const uint16_t number = xcp_word(call->c + 2);
    return number < x->n_lists ? &x->lists[number] : NULL;
}

/* The ODT that a command is about, NULL where there is none */
static inline xcp_span *xcp_odt_of(xcp *x, const xcp_call *call)
{
    const xcp_list *list = xcp_list_of(x, call);
    return list && call->c[4] < list->odts.count ? &x->odts[list->odts.first + call->c[4]] : NULL;
}

/* The commands: each returns XCP_OK, or the code of an error. */

static inline uint8_t xcp_connect(xcp *x, xcp_call *call)
{
    xcp_free(x);
    x->connected = true;
    call->a[1] = 0x05; /* calibration and DAQ */
    call->a[2] = 0x80; /* Intel's order of bytes, addresses of bytes; GET_COMM_MODE_INFO is there */
    call->a[3] = XCP_MAX_CTO;
    xcp_put(call->a + 4, XCP_MAX_DTO, 2);
    call->a[6] = call->a[7] = 1; /* versions of the protocol, and of the transport */
    call->n = 8;
    return XCP_OK;
}

static inline uint8_t xcp_disconnect(xcp *x, xcp_call *call)
{
    (void)call;
    xcp_stop(x);
    x->connected = false;
    return XCP_OK;
}

static inline uint8_t xcp_get_status(xcp *x, xcp_call *call)
{
    call->a[1] = xcp_is_running(x) ? 0x40 : 0x00;
    call->n = 6;
    return XCP_OK;
}

static inline uint8_t xcp_synch(xcp *x, xcp_call *call)
{
    (void)x, (void)call;
    return XCP_SYNCHRONISED;
}

static inline uint8_t xcp_get_comm_mode_info(xcp *x, xcp_call *call)
{
    (void)x;
    call->a[7] = 0x10; /* version; no block mode, no interleaved mode */
    call->n = 8;
    return XCP_OK;
}

/* The name of the model, also as that of its file; or its EPK; nothing for what else is asked for */
static inline uint8_t xcp_get_id(xcp *x, xcp_call *call)
{
    const char *epk = (const char *)x->readable[1].bytes;
    const char *text = call->c[1] <= 1 ? x->name : call->c[1] == 5 ? epk : "";
    size_t length = strlen(text);
    length = length < XCP_MAX_CTO - 8 ? length : XCP_MAX_CTO - 8;
    call->a[1] = 1; /* it is in this answer */
    xcp_put(call->a + 4, (uint32_t)length, 4);
    memcpy(call->a + 8, text, length);
    call->n = 8 + length;
    return XCP_OK;
}

static inline uint8_t xcp_set_mta(xcp *x, xcp_call *call)
{
    if (call->c[3])
        return XCP_OUT_OF_RANGE; /* there is no extension of addresses */
    x->mta = xcp_long(call->c + 4);
    return XCP_OK;
}

static inline uint8_t xcp_upload(xcp *x, xcp_call *call)
{
    const uint8_t size = call->c[1];
    const uint8_t *bytes = xcp_find(x, x->mta, size);
    if (!bytes || size == 0 || size > XCP_MAX_CTO - 1)
        return XCP_OUT_OF_RANGE;
    memcpy(call->a + 1, bytes, size);
    x->mta += size;
    call->n = 1 + (size_t)size;
    return XCP_OK;
}

static inline uint8_t xcp_short_upload(xcp *x, xcp_call *call)
{
    const uint8_t code = xcp_set_mta(x, call);
    return code == XCP_OK ? xcp_upload(x, call) : code;
}

static inline uint8_t xcp_download(xcp *x, xcp_call *call)
{
    const uint8_t size = call->c[1];
    uint8_t code;
    if (size == 0 || size > call->size - 2)
        return XCP_SYNTAX;
    if (!xcp_find(x, x->mta, size))
        return XCP_OUT_OF_RANGE;
    if (x->mta >= XCP_TEXTS)
        return XCP_ACCESS_DENIED;
    code = x->write(x->memory, x->mta - x->readable[0].address, call->c + 2, size);
    x->mta += code == XCP_OK ? size : 0U;
    return code;
}

static inline uint8_t xcp_get_daq_processor_info(xcp *x, xcp_call *call)
{
    call->a[1] = 0x13; /* dynamic lists, a prescaler, time stamps */
    call->a[2] = x->n_lists;
    call->a[4] = 1; /* event */
    call->n = 8;
    return XCP_OK;
}

static inline uint8_t xcp_get_daq_resolution_info(xcp *x, xcp_call *call)
{
    (void)x;
    call->a[1] = call->a[3] = 1; /* byte */
    call->a[2] = XCP_MAX_DTO - 1 - XCP_STAMP_SIZE;
    call->a[5] = 0x3C; /* stamps of 4 bytes in us, always */
    call->a[6] = 1;
    call->n = 8;
    return XCP_OK;
}

static inline uint8_t xcp_get_daq_event_info(xcp *x, xcp_call *call)
{
    if (xcp_word(call->c + 2))
        return XCP_OUT_OF_RANGE;
    call->a[1] = 0x84; /* measured, all values of one moment */
    call->a[2] = 0xFF; /* lists */
    call->a[3] = sizeof XCP_EVENT_NAME - 1;
    x->mta = XCP_TEXTS + x->readable[1].size - (uint32_t)sizeof XCP_EVENT_NAME;
    call->n = 7;
    return XCP_OK;
}

static inline uint8_t xcp_free_daq(xcp *x, xcp_call *call)
{
    (void)call;
    xcp_free(x);
    return XCP_OK;
}

static inline uint8_t xcp_alloc_daq(xcp *x, xcp_call *call)
{
    const uint16_t count = xcp_word(call->c + 2);
    if (x->allocated)
        return XCP_SEQUENCE;
    if (count > XCP_LISTS)
        return XCP_MEMORY_OVERFLOW;
    x->allocated = 1;
    x->n_lists = (uint8_t)count;
    return XCP_OK;
}

static inline uint8_t xcp_alloc_odt(xcp *x, xcp_call *call)
{
    xcp_list *list = xcp_list_of(x, call);
    const uint8_t count = call->c[4];
    if (x->allocated < 1 || x->allocated > 2 || (list && list->odts.count))
        return XCP_SEQUENCE;
    if (!list)
        return XCP_OUT_OF_RANGE;
    if (count > XCP_ODTS - x->n_odts)
        return XCP_MEMORY_OVERFLOW;
    x->allocated = 2;
    list->odts.first = x->n_odts;
    list->odts.count = count;
    x->n_odts = (uint8_t)(x->n_odts + count);
    return XCP_OK;
}

static inline uint8_t xcp_alloc_odt_entry(xcp *x, xcp_call *call)
{
    xcp_span *odt = xcp_odt_of(x, call);
    const uint8_t count = call->c[5];
    if (x->allocated < 2 || (odt && odt->count))
        return XCP_SEQUENCE;
    if (!odt)
        return XCP_OUT_OF_RANGE;
    if (count > XCP_ENTRIES - x->n_entries)
        return XCP_MEMORY_OVERFLOW;
    x->allocated = 3;
    odt->first = x->n_entries;
    odt->count = count;
    x->n_entries = (uint8_t)(x->n_entries + count);
    return XCP_OK;
}

static inline uint8_t xcp_set_daq_ptr(xcp *x, xcp_call *call)
{
    const xcp_span *odt = xcp_odt_of(x, call);
    const uint8_t entry = call->c[5];
    if (!odt || entry >= odt->count)
        return XCP_OUT_OF_RANGE;
    x->at.first = (uint8_t)(odt->first + entry);
    x->at.count = (uint8_t)(odt->count - entry);
    return XCP_OK;
}

static inline uint8_t xcp_write_daq(xcp *x, xcp_call *call)
{
    const uint8_t size = call->c[2];
    const uint8_t *bytes = xcp_find(x, xcp_long(call->c + 4), size);
    if (call->c[1] != 0xFF || call->c[3] || !bytes || x->at.count == 0)
        return XCP_OUT_OF_RANGE; /* no single bits, no extension of addresses, no more entries */
    x->entries[x->at.first].bytes = bytes;
    x->entries[x->at.first].size = size;
    x->at.first++;
    x->at.count--;
    return XCP_OK;
}

static inline uint8_t xcp_clear_daq_list(xcp *x, xcp_call *call)
{
    const xcp_list *list = xcp_list_of(x, call);
    int i;
    if (!list)
        return XCP_OUT_OF_RANGE;
    for (i = 0; i < list->odts.count; i++) {
        const xcp_span *odt = &x->odts[list->odts.first + i];
        memset(x->entries + odt->first, 0, odt->count * sizeof *x->entries);
    }
    return XCP_OK;
}

static inline uint8_t xcp_set_daq_list_mode(xcp *x, xcp_call *call)
{
    xcp_list *list = xcp_list_of(x, call);
    if (call->c[1] != 0x10)
        return XCP_MODE_NOT_VALID; /* measured, with time stamps */
    if (!list || xcp_word(call->c + 4) || call->c[6] == 0)
        return XCP_OUT_OF_RANGE;
    list->prescaler = call->c[6];
    return XCP_OK;
}

/* Whether each message of a list is small enough, and its mode is set */
static inline bool xcp_may_start(const xcp *x, const xcp_list *list)
{
    int i, k;
    for (i = 0; i < list->odts.count; i++) {
        const xcp_span *odt = &x->odts[list->odts.first + i];
        int size = 1 + (i == 0 ? XCP_STAMP_SIZE : 0);
        for (k = 0; k < odt->count; k++)
            size += x->entries[odt->first + k].size;
        if (size > XCP_MAX_DTO)
            return false;
    }
    return list->prescaler > 0 && list->odts.count > 0;
}

static inline void xcp_start(xcp_list *list)
{
    list->running = true;
    list->passed = (uint8_t)(list->prescaler - 1); /* so the next event is the first */
}

/* Stop a list, start it, or select it */
static inline uint8_t xcp_start_stop_daq_list(xcp *x, xcp_call *call)
{
    xcp_list *list = xcp_list_of(x, call);
    const uint8_t mode = call->c[1];
    if (!list)
        return XCP_OUT_OF_RANGE;
    if (mode > 2)
        return XCP_MODE_NOT_VALID;
    if (mode == 1 && !xcp_may_start(x, list))
        return XCP_DAQ_CONFIG;
    if (mode == 0)
        list->running = false;
    else if (mode == 1)
        xcp_start(list);
    list->selected = mode == 2;
    call->a[1] = list->odts.first;
    call->n = 2;
    return XCP_OK;
}

/* Stop all lists, start those selected, or stop those selected */
static inline uint8_t xcp_start_stop_synch(xcp *x, xcp_call *call)
{
    const uint8_t mode = call->c[1];
    xcp_list *list;
    if (mode > 2)
        return XCP_MODE_NOT_VALID;
    for (list = x->lists; mode == 1 && list < x->lists + x->n_lists; list++)
        if (list->selected && !xcp_may_start(x, list))
            return XCP_DAQ_CONFIG;
    for (list = x->lists; list < x->lists + x->n_lists; list++) {
        if (mode == 0 || (mode == 2 && list->selected))
            list->running = false;
        else if (mode == 1 && list->selected)
            xcp_start(list);
        list->selected = false;
    }
    return XCP_OK;
}

static inline uint8_t xcp_get_daq_clock(xcp *x, xcp_call *call)
{
    xcp_put(call->a + 4, x->now, 4);
    call->n = 8;
    return XCP_OK;
}

/* The commands that there are: code, bytes that each has at least, whether nothing may be measured */
typedef struct {
    uint8_t code, size;
    bool at_rest;
    uint8_t (*handler)(xcp *x, xcp_call *call);
} xcp_command;

static inline const xcp_command *xcp_command_of(uint8_t code)
{
    static const xcp_command commands[] = {
        {0xFF, 2, false, xcp_connect},
        {0xFE, 1, false, xcp_disconnect},
        {0xFD, 1, false, xcp_get_status},
        {0xFC, 1, false, xcp_synch},
        {0xFB, 1, false, xcp_get_comm_mode_info},
        {0xFA, 2, false, xcp_get_id},
        {0xF6, 8, false, xcp_set_mta},
        {0xF5, 2, false, xcp_upload},
        {0xF4, 8, false, xcp_short_upload},
        {0xF0, 3, false, xcp_download},
        {0xE3, 4, true, xcp_clear_daq_list},
        {0xE2, 6, true, xcp_set_daq_ptr},
        {0xE1, 8, true, xcp_write_daq},
        {0xE0, 8, true, xcp_set_daq_list_mode},
        {0xDE, 4, false, xcp_start_stop_daq_list},
        {0xDD, 2, false, xcp_start_stop_synch},
        {0xDC, 1, false, xcp_get_daq_clock},
        {0xDA, 1, false, xcp_get_daq_processor_info},
        {0xD9, 1, false, xcp_get_daq_resolution_info},
        {0xD7, 4, false, xcp_get_daq_event_info},
        {0xD6, 1, true, xcp_free_daq},
        {0xD5, 4, true, xcp_alloc_daq},
        {0xD4, 5, true, xcp_alloc_odt},
        {0xD3, 6, true, xcp_alloc_odt_entry},
    };
    size_t i;
    for (i = 0; i < sizeof commands / sizeof *commands; i++)
        if (commands[i].code == code)
            return &commands[i];
    return NULL;
}

static inline uint8_t xcp_done(xcp *x, xcp_call *call)
{
    const xcp_command *command = xcp_command_of(call->c[0]);
    if (!command)
        return XCP_UNKNOWN;
    if (call->size < command->size)
        return XCP_SYNTAX;
    if (command->at_rest && xcp_is_running(x))
        return XCP_DAQ_ACTIVE;
    return command->handler(x, call);
}

static inline bool xcp_is_connect(const uint8_t *datagram, size_t size)
{
    return size >= XCP_HEAD_SIZE + 2 && datagram[XCP_HEAD_SIZE] == 0xFF;
}

/* The bytes of a message, behind its head, which is written */
static inline size_t xcp_framed(xcp *x, uint8_t *message, size_t size)
{
    xcp_put(message, (uint32_t)size, 2);
    xcp_put(message + 2, x->counter++, 2);
    return XCP_HEAD_SIZE + size;
}

/* Do the command in a datagram, and put its answer, of XCP_ANSWER_SIZE bytes at most, into another.
 * Returns the size of that, 0 where there is none: to what is torn, and before CONNECT.
 */
static inline size_t xcp_receive(xcp *x, const uint8_t *datagram, size_t size, uint32_t now,
        uint8_t *answer)
{
    xcp_call call;
    uint8_t code;
    if (size <= XCP_HEAD_SIZE)
        return 0;
    call.c = datagram + XCP_HEAD_SIZE;
    call.size = xcp_word(datagram);
    call.a = answer + XCP_HEAD_SIZE;
    call.n = 1;
    if (call.size == 0 || call.size > size - XCP_HEAD_SIZE || call.size > XCP_MAX_CTO)
        return 0;
    if (!x->connected && !xcp_is_connect(datagram, size))
        return 0;
    x->now = now;
    memset(call.a, 0, XCP_MAX_CTO);
    code = xcp_done(x, &call);
    call.a[0] = code == XCP_OK ? XCP_OK : XCP_ERROR;
    if (code != XCP_OK) {
        call.a[1] = code;
        call.n = 2;
    }
    return xcp_framed(x, answer, call.n);
}

/* Send a message of a list: its number, in the first one the time, then the bytes of its entries */
static inline void xcp_send_odt(xcp *x, const xcp_list *list, uint8_t number, xcp_send send,
        void *context)
{
    const xcp_span *odt = &x->odts[list->odts.first + number];
    uint8_t *to = x->message + XCP_HEAD_SIZE;
    int k;
    *to++ = (uint8_t)(list->odts.first + number);
    if (number == 0) {
        xcp_put(to, x->now, XCP_STAMP_SIZE);
        to += XCP_STAMP_SIZE;
    }
    for (k = 0; k < odt->count; k++) {
        const xcp_entry *entry = &x->entries[odt->first + k];
        if (entry->size)
            memcpy(to, entry->bytes, entry->size);
        to += entry->size;
    }
    send(context, x->message,
            xcp_framed(x, x->message, (size_t)(to - x->message) - XCP_HEAD_SIZE));
}

/* A step is done: send what the running lists have of it. */
static inline void xcp_event(xcp *x, uint32_t now, xcp_send send, void *context)
{
    xcp_list *list;
    uint8_t i;
    x->now = now;
    for (list = x->lists; list < x->lists + x->n_lists; list++) {
        if (!list->running || ++list->passed < list->prescaler)
            continue;
        list->passed = 0;
        for (i = 0; i < list->odts.count; i++)
            xcp_send_odt(x, list, i, send, context);
    }
}

#endif
