/* A bench with the gripper plant whose outputs are observed: each write to its "DAC" is noted, with the
 * time of the machine, in a file that others map as well.
 *
 *   DAC=FILE [FAIL_AT=S] observed_bench PORT [KEY_FILE|- [PERIOD]]
 *
 * The step hook fails from FAIL_AT on, in s of the model.
 */
#define GRIPPER_PLANT_EXAMPLE_MAIN
#include "gripper_plant.h"

#include "GripperPlant.h"

#include <sys/mman.h>

enum { ENTRIES = 1 << 16 };

typedef struct {
    int64_t ns;
    double force[2];
    int64_t writer; /* the process */
} Entry;

typedef struct {
    int64_t count;
    Entry entries[ENTRIES];
} Log;

static Log *dac;
static GripperPlant_State state;

static void write_dac(double first, double second)
{
    int64_t place = __atomic_fetch_add(&dac->count, 1, __ATOMIC_SEQ_CST);
    Entry *entry = &dac->entries[place % ENTRIES];
    entry->force[0] = first;
    entry->force[1] = second;
    entry->writer = (int64_t)getpid();
    __atomic_store_n(&entry->ns, gripper_plant_now(), __ATOMIC_SEQ_CST);
}

/* The first call opens the hardware; what it opens is there in the guard as well. */
void gripper_plant_write_safe(gripper_plant_inputs *u)
{
    if (!dac) {
        int file = open(getenv("DAC"), O_RDWR);
        void *mapped = file < 0 ? MAP_FAILED
                                : mmap(NULL, sizeof *dac, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
        if (mapped == MAP_FAILED) {
            perror("DAC");
            _exit(4);
        }
        dac = (Log *)mapped;
    }
    u->force_1 = u->force_2 = 0.0;
    write_dac(0.0, 0.0);
}

static const char *go_on(double h, const gripper_plant_inputs *inputs,
                         const gripper_plant_parameters *parameters, gripper_plant_outputs *outputs)
{
    static char why[GRIPPERPLANT_WHY_SIZE];
    GripperPlant_Inputs u;
    GripperPlant_Parameters p;
    GripperPlant_Outputs y;
    int fault;
    memcpy(&u, inputs, sizeof u);
    memcpy(&p, parameters, sizeof p);
    fault = GripperPlant_check(&p, NULL);
    if (!fault)
        fault = h > 0.0 ? GripperPlant_step(&p, &u, h, &state, &y, NULL)
                        : GripperPlant_initial_state(&p, &u, &state, &y, NULL);
    if (fault) {
        GripperPlant_explain(&p, &u, h, &state, why);
        return why;
    }
    memcpy(outputs, &y, sizeof y);
    return NULL;
}

const char *gripper_plant_initialise(double time, const gripper_plant_inputs *u,
                                     const gripper_plant_parameters *p, gripper_plant_outputs *y)
{
    (void)time;
    return go_on(0.0, u, p, y);
}

const char *gripper_plant_step(double time, double step, const gripper_plant_inputs *u,
                               const gripper_plant_parameters *p, gripper_plant_outputs *y)
{
    const char *fail_at = getenv("FAIL_AT");
    if (fail_at && time >= strtod(fail_at, NULL))
        return "the amplifier is off";
    write_dac(u->force_1, u->force_2);
    return go_on(step, u, p, y);
}
