/* The controller on a Cortex-M without an operating system: a step of its C each millisecond.
 *
 * Here its inputs are those of a recorded run, with whose outputs it compares its own. On a board
 * put your converters into read_inputs() and write_outputs(), your clock into CLOCK, your memory
 * into cortex_m.ld. It speaks to the debugger (semihosting). Commands: docs/how_to/microcontroller.md.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "GraspController.h"

enum { CLOCK = 25000000, PERIOD = CLOCK / 1000 }; /* Hz, of the core; its ticks in a step */
static const double h = 1e-3;                     /* s, a step */

/* A row a step: the inputs, then the outputs */
__attribute__((section(".recorded"))) static const double recorded[] = {
#include "recorded.h"
};
enum { ROW = (sizeof(GraspController_Inputs) + sizeof(GraspController_Outputs)) / sizeof(double) };
enum { STEPS = sizeof recorded / sizeof(double) / ROW };
static double difference; /* the largest from a recorded output */

static void read_inputs(uint32_t k, GraspController_Inputs *u)
{
    memcpy(u, recorded + k * ROW, sizeof *u); /* Here: what is measured */
}

/* Before the first step, and whenever something fails */
static void write_safe(void)
{
    /* Here: actuators off */
}

static void write_outputs(uint32_t k, const GraspController_Outputs *y)
{
    const double *output = (const double *)(y + 1), *expected = recorded + (k + 1) * ROW;
    while (output > (const double *)y) /* Here: to the actuators */
        if (!(fabs(*--output - *--expected) <= difference))
            difference = fabs(*output - *expected);
}

/* Call the debugger: 0x04 writes a text, 0x18 ends. */
static void semihosting(uintptr_t operation, uintptr_t argument)
{
    register uintptr_t r0 __asm("r0") = operation, r1 __asm("r1") = argument;
    __asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static void say(const char *what, uint32_t number)
{
    char text[] = "0000000000\n", *digit = text + 10;
    do
        *--digit = (char)('0' + number % 10);
    while (number /= 10);
    semihosting(0x04, (uintptr_t)what);
    semihosting(0x04, (uintptr_t)digit);
}

static void fail(const char *why, uint32_t number)
{
    write_safe();
    say(why, number);
    for (;;) semihosting(0x18, 0x20023);
}

#define TIMER ((volatile uint32_t *)0xE000E010) /* control, reload, and a value that counts down */
#define PENDING (*(volatile uint32_t *)0xE000ED04)
enum { DUE = 1 << 26, SEEN = 1 << 25 }; /* the timer's, in PENDING */
extern char stack_low[], stack_top[], data_low[], data_top[], data_in_flash[], bss_low[], bss_top[];

/* What is left of a period: a count of ticks since another is their difference. */
static uint32_t ticks_since(uint32_t before)
{
    const uint32_t period = TIMER[1] + 1;
    return (before + period - TIMER[2]) % period;
}

static uint32_t stack_used(void)
{
    const char *unused = stack_low;
    while (*unused == 0x55)
        unused++;
    return (uint32_t)(stack_top - unused);
}

/* What a step costs that is refused, as an input is none */
static void measure_refusal(const GraspController_Parameters *p, GraspController_Inputs u,
                            GraspController_State *x)
{
    GraspController_Outputs y;
    uint32_t before;
    int wrong;
    u.position_1 = NAN;
    before = TIMER[2];
    if (!GraspController_step(p, &u, h, x, &y, &wrong) || wrong)
        fail("not refused: ", (uint32_t)wrong);
    say("ticks of a refusal: ", ticks_since(before));
    say("bytes of stack with a refusal: ", stack_used());
}

#ifdef WITH_LINK
#include "grasp_controller.h"

/* A session with a proxy whose datagrams are made here, keyed: what a STEP costs, from its datagram to
 * that of the answer
 */
static grasp_controller_link link_to_proxy;
static uint8_t datagram[2048], answer[GRASP_CONTROLLER_ANSWER_SIZE];

static size_t packed(uint8_t kind, uint64_t sequence, double step, size_t body)
{
    memcpy(datagram, "GRSP", 4);
    grasp_controller_put(datagram + GRASP_CONTROLLER_AT_VERSION, 2, GRASP_CONTROLLER_VERSION);
    datagram[GRASP_CONTROLLER_AT_KIND] = kind;
    memcpy(datagram + GRASP_CONTROLLER_AT_INTERFACE, grasp_controller_hash(), 16);
    memcpy(datagram + GRASP_CONTROLLER_AT_COOKIE, answer + GRASP_CONTROLLER_AT_COOKIE, 8);
    grasp_controller_put(datagram + GRASP_CONTROLLER_AT_SEQUENCE, 8, sequence);
    grasp_controller_put_real(datagram + GRASP_CONTROLLER_AT_STEP, step);
    grasp_controller_put(datagram + GRASP_CONTROLLER_AT_SIZE, 4, body);
    return grasp_controller_seal(&link_to_proxy.sealer, datagram, GRASP_CONTROLLER_HEAD_SIZE + body);
}

static void measure_keyed_step(const GraspController_Parameters *p, GraspController_State *x)
{
    static const uint8_t key[] = "a key of thirty-two bytes, or so", random[] = "not at random...";
    const size_t body = sizeof(GraspController_Inputs) / 8 * 8 + GRASP_CONTROLLER_PARAMETERS_SIZE;
    GraspController_Inputs u;
    GraspController_Outputs y;
    uint32_t before;
    size_t size, n;
    grasp_controller_link_init(&link_to_proxy, random, key, 32);
    grasp_controller_link_receive(&link_to_proxy, datagram,
                                  packed(GRASP_CONTROLLER_HELLO, 0, 0.0, GRASP_CONTROLLER_HELLO_SIZE),
                                  0, answer, &n);
    memset(datagram, 0, sizeof datagram);
    grasp_controller_link_receive(&link_to_proxy, datagram,
                                  packed(GRASP_CONTROLLER_INITIALISE, 1, 0.0, body), 0, answer, &n);
    if (!grasp_controller_link_answer(&link_to_proxy, 0.0, answer))
        fail("no session ", 0);
    size = packed(GRASP_CONTROLLER_STEP, 2, h, body);
    TIMER[1] = 0xFFFFFF; /* the longest period: it may take more than a step */
    TIMER[2] = 0;        /* which begins it */
    while (!(before = TIMER[2]));
    grasp_controller_link_receive(&link_to_proxy, datagram, size, 0, answer, &n);
    memcpy(&u, recorded, sizeof u);
    if (GraspController_step(p, &u, h, x, &y, NULL))
        fail("refused ", 0);
    memcpy(&link_to_proxy.outputs, &y, sizeof y);
    n = grasp_controller_link_answer(&link_to_proxy, h, answer);
    say("ticks of a keyed STEP: ", ticks_since(before));
    say("bytes of its answer: ", (uint32_t)n);
    say("bytes of stack with it: ", stack_used());
}
#endif

#ifdef WITH_XCP
#include "GraspController_xcp.h"

/* A session with a master of XCP whose datagrams are made here: what the event costs in which six
 * doubles are measured. The memory is global: a2ltool finds its address in the ELF file.
 */
GraspController_Memory GraspController_memory = GRASPCONTROLLER_MEMORY_DEFAULTS;
static xcp slave;
static uint32_t sent;

static void send_to_master(void *context, const uint8_t *datagram, size_t size)
{
    (void)context, (void)datagram; /* Here: to the network */
    sent += size;
}

static void command(uint8_t code, uint8_t a, uint8_t b, uint8_t c, uint32_t last)
{
    uint8_t message[XCP_ANSWER_SIZE] = {8, 0, 0, 0, code, a, b, c}, answer_to_it[XCP_ANSWER_SIZE];
    xcp_put(message + 8, last, 4);
    if (!xcp_receive(&slave, message, 12, 0, answer_to_it) || answer_to_it[4] != XCP_OK)
        fail("XCP refuses ", code);
}

static void measure_xcp(void)
{
    GraspController_Memory *m = &GraspController_memory;
    uint32_t address = (uint32_t)(uintptr_t)m, before, i;
    GraspController_xcp_init(&slave, m, address);
    command(0xFF, 0, 0, 0, 0);
    command(0xD6, 0, 0, 0, 0);
    command(0xD5, 0, 1, 0, 0); /* a list */
    command(0xD4, 0, 0, 0, 1); /* a message */
    command(0xD3, 0, 0, 0, 6 << 8);
    command(0xE2, 0, 0, 0, 0);
    for (i = 0; i < 6; i++)
        command(0xE1, 0xFF, 8, 0, address + offsetof(GraspController_Memory, outputs) + 8 * i);
    command(0xE0, 0x10, 0, 0, 1 << 16);
    command(0xDE, 1, 0, 0, 0);
    before = TIMER[2];
    xcp_event(&slave, 1, send_to_master, NULL);
    say("ticks of a DAQ event: ", ticks_since(before));
    say("bytes that it sends: ", sent);
    say("bytes of memory for XCP: ", sizeof slave + sizeof *m);
}
#endif

int main(void)
{
    static const GraspController_Parameters p = GRASPCONTROLLER_PARAMETERS_DEFAULTS;
    uint32_t k, ticks, all = 0, longest = 0, late = 0;
    GraspController_Inputs u;
    GraspController_State x;
    GraspController_Outputs y;
    int wrong;
    write_safe();
    if (GraspController_check(&p, &wrong))
        fail("a parameter is refused: number ", (uint32_t)wrong);
    TIMER[1] = PERIOD - 1;
    TIMER[0] = 7; /* on, by the clock of the core, pending at its end */
    for (k = 0; k < STEPS; k++) {
        late += (PENDING & DUE) != 0;
        while (!(PENDING & DUE)) __asm volatile("wfi");
        PENDING = SEEN;
        ticks = TIMER[2];
        read_inputs(k, &u);
        if (k == 0 ? GraspController_initial_state(&p, &u, &x, &y, &wrong)
                   : GraspController_step(&p, &u, h, &x, &y, &wrong))
            fail("a step is refused: number ", (uint32_t)wrong);
        ticks = ticks_since(ticks);
        write_outputs(k, &y);
        all += ticks;
        longest = ticks > longest ? ticks : longest;
    }
    say("steps: ", STEPS);
    say("steps begun late: ", late);
    say("ticks of the clock a step: ", all / STEPS);
    say("ticks of the longest: ", longest);
    say("bytes of stack: ", stack_used());
    say("largest difference, 1e-18: ", (uint32_t)fmin(difference * 1e18, UINT32_MAX));
    measure_refusal(&p, u, &x);
#ifdef WITH_LINK
    measure_keyed_step(&p, &x);
#endif
#ifdef WITH_XCP
    measure_xcp();
#endif
    semihosting(0x18, 0x20026);
}

static void fault(void) { fail("fault ", 0); }

static void reset(void)
{
    *(volatile uint32_t *)0xE000ED88 |= 0xF << 20; /* the unit for floating point is on */
    __asm volatile("cpsid i\n dsb\n isb"); /* interrupts end wfi, none is taken */
    memcpy(data_low, data_in_flash, (size_t)(data_top - data_low));
    memset(bss_low, 0, (size_t)(bss_top - bss_low));
    memset(stack_low, 0x55, (size_t)(stack_top - stack_low - 128)); /* to see how far it goes */
    main();
}

/* What the core calls, from vector 1 on: cortex_m.ld puts the stack before them. */
__attribute__((section(".vectors"), used)) static void (*const vectors[15])(void) = {
    reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, fault, fault, 0, fault, fault,
};
