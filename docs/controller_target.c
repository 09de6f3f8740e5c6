/* The controller on a target: the C of the block alone, behind the header of its proxy.
 *
 *   grasp-cosim build --native --c-only controller_c GraspController
 *   grasp-cosim proxy fmus/build/GraspController.fmu --c-header controller_c/grasp_controller.h
 *   cc -std=c99 -O2 -ffp-contract=off -I controller_c docs/controller_target.c \
 *       controller_c/GraspController.c controller_c/GraspController_text.c \
 *       -o controller_target -lm
 *   ./controller_target 5504
 *
 * With `build --a2l` and -DWITH_XCP=5555 a master of XCP on this computer measures and calibrates it
 * meanwhile, at UDP port 5555: docs/how_to/calibrate.md.
 */
#ifdef WITH_XCP
static void do_commands(void);
#define GRASP_CONTROLLER_BETWEEN_STEPS do_commands
#endif
#define GRASP_CONTROLLER_EXAMPLE_MAIN
#include "grasp_controller.h"

#include "GraspController.h"

#ifdef WITH_XCP
#include "GraspController_xcp.h"
#include "xcp_udp.h"
#else
typedef struct {
    GraspController_Parameters parameters;
    GraspController_Inputs inputs;
    GraspController_Outputs outputs;
    GraspController_State state;
} GraspController_Memory;
#endif

static GraspController_Memory GraspController_memory;
static grasp_controller_parameters told; /* by the proxy, last */
static char why[GRASPCONTROLLER_WHY_SIZE];

/* The structs of both headers have the same members in the same order. */
typedef char inputs_are_alike
    [sizeof(GraspController_Inputs) == sizeof(grasp_controller_inputs) ? 1 : -1];
typedef char parameters_are_alike
    [sizeof(GraspController_Parameters) == sizeof(grasp_controller_parameters) ? 1 : -1];
typedef char outputs_are_alike
    [sizeof(GraspController_Outputs) == sizeof(grasp_controller_outputs) ? 1 : -1];

#ifdef WITH_XCP
static xcp_server server;

static void do_commands(void)
{
    if (!server.slave.name) { /* the first time: the network is there */
        GraspController_xcp_init(&server.slave, &GraspController_memory, GRASPCONTROLLER_XCP_ADDRESS);
        if (!xcp_listen(&server, "127.0.0.1", WITH_XCP))
            exit(3);
    }
    xcp_do_commands(&server, server.slave.now);
}

static void measure(double time)
{
    xcp_event(&server.slave, (uint32_t)(int64_t)(time * 1e6 + 0.5), xcp_to_master, &server);
}
#else
static void measure(double time) { (void)time; }
#endif

/* A step of h seconds to a time, or the beginning where h is 0 */
static const char *control(double time, double h, const grasp_controller_inputs *inputs,
                           const grasp_controller_parameters *parameters,
                           grasp_controller_outputs *outputs)
{
    GraspController_Memory *m = &GraspController_memory;
    int fault = GRASPCONTROLLER_OK;
    memcpy(&m->inputs, inputs, sizeof m->inputs);
    if (h == 0.0 || memcmp(&told, parameters, sizeof told) != 0) { /* what is set last holds */
        told = *parameters;
        memcpy(&m->parameters, parameters, sizeof m->parameters);
        fault = GraspController_check(&m->parameters, NULL);
    }
    if (!fault)
        fault = h > 0.0 ? GraspController_step(&m->parameters, &m->inputs, h, &m->state, &m->outputs,
                                               NULL)
                        : GraspController_initial_state(&m->parameters, &m->inputs, &m->state,
                                                        &m->outputs, NULL);
    if (fault) {
        GraspController_explain(&m->parameters, &m->inputs, h, &m->state, why);
        return why;
    }
    measure(time);
    memcpy(outputs, &m->outputs, sizeof *outputs);
    return NULL;
}

const char *grasp_controller_initialise(double time, const grasp_controller_inputs *inputs,
                                        const grasp_controller_parameters *parameters,
                                        grasp_controller_outputs *outputs)
{
    return control(time, 0.0, inputs, parameters, outputs);
}

const char *grasp_controller_step(double time, double step, const grasp_controller_inputs *inputs,
                                  const grasp_controller_parameters *parameters,
                                  grasp_controller_outputs *outputs)
{
    return control(time + step, step, inputs, parameters, outputs);
}

void grasp_controller_write_safe(grasp_controller_inputs *inputs)
{
    /* Here: zero forces to your drives. What goes on meanwhile: fingers at rest, nothing near */
    static const grasp_controller_inputs nothing;
    *inputs = nothing;
}
