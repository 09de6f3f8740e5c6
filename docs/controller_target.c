/* A controller on a target: the contact force control of Case 0, Eq. (7), in place of your own.
 *
 *   grasp-cosim proxy fmus/build/GraspController.fmu --c-header grasp_controller.h
 *   cc -std=c99 -I . docs/controller_target.c -o controller_target -lm
 *   ./controller_target 5504
 *
 * It has no state: every answer follows from the inputs of its request.
 */
#define GRASP_CONTROLLER_EXAMPLE_MAIN
#include "grasp_controller.h"

static void control(const grasp_controller_inputs *u, const grasp_controller_parameters *p,
                    grasp_controller_outputs *y)
{
    static const grasp_controller_outputs nothing;
    double damping = p->contact_force_damping, stiffness = p->contact_force_stiffness;
    double middle = 0.5 * (u->position_1 + u->position_2);
    *y = nothing;
    y->force_1 = -damping * u->velocity_1 - stiffness * (u->position_1 - middle);
    y->force_2 = -damping * u->velocity_2 - stiffness * (u->position_2 - middle);
    y->target_position = y->virtual_position_1 = y->virtual_position_2 = middle;
}

const char *grasp_controller_initialise(double time, const grasp_controller_inputs *u,
                                        const grasp_controller_parameters *p,
                                        grasp_controller_outputs *y)
{
    (void)time;
    if (p->simultaneous_contact_enabled || p->impact_reduction_enabled)
        return "layers 2 and 3 are not on this target: must be switched off";
    control(u, p, y);
    return NULL;
}

const char *grasp_controller_step(double time, double step, const grasp_controller_inputs *u,
                                  const grasp_controller_parameters *p,
                                  grasp_controller_outputs *y)
{
    (void)time, (void)step;
    control(u, p, y);
    return NULL;
}

void grasp_controller_make_safe(grasp_controller_inputs *u)
{
    /* What a silent loop leaves behind: fingers at rest in the middle, so no force */
    u->velocity_1 = u->velocity_2 = 0.0;
    u->position_1 = u->position_2 = 0.0;
}
