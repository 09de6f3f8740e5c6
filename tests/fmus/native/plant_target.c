/* The gripper plant on a target: the C of the block alone, behind the header of its proxy.
 *
 *   plant_target PORT [KEY_FILE|- [PERIOD]]    prints "listening on PORT"; PORT 0 takes a free one
 *
 * The structs of both headers have the same members in the same order.
 */
#define GRIPPER_PLANT_EXAMPLE_MAIN
#include "gripper_plant.h"

#include "GripperPlant.h"

static GripperPlant_State state;
static char why[GRIPPERPLANT_WHY_SIZE];

/* A step of h seconds, or the beginning where h is 0 */
static const char *go_on(double h, const gripper_plant_inputs *inputs,
                         const gripper_plant_parameters *parameters, gripper_plant_outputs *outputs)
{
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
    (void)time;
    return go_on(step, u, p, y);
}

void gripper_plant_write_safe(gripper_plant_inputs *u)
{
    u->force_1 = u->force_2 = 0.0;
    fprintf(stderr, "safe\n");
}
