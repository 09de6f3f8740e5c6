/* The controller on a target: the C of the block alone, behind the header of its proxy.
 *
 *   grasp-cosim build --native --c-only controller_c GraspController
 *   grasp-cosim proxy fmus/build/GraspController.fmu --c-header controller_c/grasp_controller.h
 *   cc -std=c99 -O2 -ffp-contract=off -I controller_c docs/controller_target.c \
 *       controller_c/GraspController.c controller_c/GraspController_text.c \
 *       -o controller_target -lm
 *   ./controller_target 5504
 */
#define GRASP_CONTROLLER_EXAMPLE_MAIN
#include "grasp_controller.h"

#include "GraspController.h"

static GraspController_State state;
static char why[GRASPCONTROLLER_WHY_SIZE];

/* The structs of both headers have the same members in the same order. */
typedef char inputs_are_alike
    [sizeof(GraspController_Inputs) == sizeof(grasp_controller_inputs) ? 1 : -1];
typedef char parameters_are_alike
    [sizeof(GraspController_Parameters) == sizeof(grasp_controller_parameters) ? 1 : -1];
typedef char outputs_are_alike
    [sizeof(GraspController_Outputs) == sizeof(grasp_controller_outputs) ? 1 : -1];

/* A step of h seconds, or the beginning where h is 0 */
static const char *control(double h, const grasp_controller_inputs *inputs,
                           const grasp_controller_parameters *parameters,
                           grasp_controller_outputs *outputs)
{
    GraspController_Inputs u;
    GraspController_Parameters p;
    GraspController_Outputs y;
    int fault;
    memcpy(&u, inputs, sizeof u);
    memcpy(&p, parameters, sizeof p);
    fault = GraspController_check(&p, NULL);
    if (!fault)
        fault = h > 0.0 ? GraspController_step(&p, &u, h, &state, &y, NULL)
                        : GraspController_initial_state(&p, &u, &state, &y, NULL);
    if (fault) {
        GraspController_explain(&p, &u, h, &state, why);
        return why;
    }
    memcpy(outputs, &y, sizeof y);
    return NULL;
}

const char *grasp_controller_initialise(double time, const grasp_controller_inputs *inputs,
                                        const grasp_controller_parameters *parameters,
                                        grasp_controller_outputs *outputs)
{
    (void)time;
    return control(0.0, inputs, parameters, outputs);
}

const char *grasp_controller_step(double time, double step, const grasp_controller_inputs *inputs,
                                  const grasp_controller_parameters *parameters,
                                  grasp_controller_outputs *outputs)
{
    (void)time;
    return control(step, inputs, parameters, outputs);
}

void grasp_controller_write_safe(grasp_controller_inputs *inputs)
{
    /* Here: zero forces to your drives. What goes on meanwhile: fingers at rest, nothing near */
    static const grasp_controller_inputs nothing;
    *inputs = nothing;
}
