/* The gripper plant of another vendor, FMI 3.0: mm, mm/s and mN, both gaps as one array.
 *
 * The equations are those of GripperPlant as C. All values of a reference are in a row.
 */
#include <stdlib.h>
#include <string.h>

#include "GripperPlant.h"
#include "fmi3Functions.h"

enum { FORCE_RIGHT = 1, FORCE_LEFT, BRAKE, GAPS = 10, TIP_RIGHT, TIP_LEFT, SPEED_RIGHT, SPEED_LEFT,
       LOAD_RIGHT, LOAD_LEFT, PART, TOUCH_RIGHT = 20, TOUCH_LEFT, START = 30 };

typedef struct {
    GripperPlant_Parameters p;
    GripperPlant_Inputs u;
    GripperPlant_State x;
    double brake;
} Model;

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early,
    const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    static const GripperPlant_Parameters P = GRIPPERPLANT_PARAMETERS_DEFAULTS;
    Model *m = calloc(1, sizeof(Model));
    (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)event_mode;
    (void)early; (void)required; (void)n; (void)environment; (void)log; (void)update;
    m->p = P;
    return m;
}

void fmi3FreeInstance(fmi3Instance instance) { free(instance); }
const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean tolerant, fmi3Float64 tolerance, fmi3Float64 start,
    fmi3Boolean stops, fmi3Float64 stop) {
    Model *m = instance;
    (void)tolerant; (void)tolerance; (void)start; (void)stops; (void)stop;
    return GripperPlant_initial_state(&m->p, &m->u, &m->x, NULL) ? fmi3Error : fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) { (void)instance; return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance instance) { (void)instance; return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance instance) { (void)instance; return fmi3Error; }

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference r[], size_t n,
                          const fmi3Float64 v[], size_t nv) {
    Model *m = instance;
    if (n != nv) return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        if (r[i] == FORCE_RIGHT) m->u.force_1 = v[i] / 1e3;
        else if (r[i] == FORCE_LEFT) m->u.force_2 = v[i] / 1e3;
        else if (r[i] == BRAKE) m->brake = v[i];
        else if (r[i] == START) m->p.initial_object_position = v[i] / 1e3;
        else return fmi3Error;
    }
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference r[], size_t n,
                          fmi3Float64 v[], size_t nv) {
    Model *m = instance;
    GripperPlant_Outputs y;
    size_t at = 0;
    if (GripperPlant_outputs(&m->p, &m->u, &m->x, &y, NULL)) return fmi3Error;
    for (size_t i = 0; i < n; i++) {
        size_t size = r[i] == GAPS ? 2 : 1;
        if (at + size > nv) return fmi3Error;
        switch (r[i]) {
        case GAPS: v[at] = 1e3 * y.gap_1; v[at + 1] = 1e3 * y.gap_2; break;
        case TIP_RIGHT: v[at] = 1e3 * y.position_1; break;
        case TIP_LEFT: v[at] = 1e3 * y.position_2; break;
        case SPEED_RIGHT: v[at] = 1e3 * y.velocity_1; break;
        case SPEED_LEFT: v[at] = 1e3 * y.velocity_2; break;
        case LOAD_RIGHT: v[at] = 1e3 * y.contact_force_1; break;
        case LOAD_LEFT: v[at] = 1e3 * y.contact_force_2; break;
        case PART: v[at] = 1e3 * y.object_position; break;
        default: return fmi3Error;
        }
        at += size;
    }
    return at == nv ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference r[], size_t n,
                          fmi3Boolean v[], size_t nv) {
    Model *m = instance;
    GripperPlant_Outputs y;
    if (n != nv || GripperPlant_outputs(&m->p, &m->u, &m->x, &y, NULL)) return fmi3Error;
    for (size_t i = 0; i < n; i++) v[i] = r[i] == TOUCH_RIGHT ? y.contact_1 : y.contact_2;
    return fmi3OK;
}

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set,
    fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    Model *m = instance;
    GripperPlant_Inputs u = m->u;
    (void)no_set;
    *event = *terminate = *early = fmi3False;
    *last = time + step;
    u.force_1 *= 1.0 - m->brake;
    u.force_2 *= 1.0 - m->brake;
    return GripperPlant_step(&m->p, &u, step, &m->x, NULL) ? fmi3Error : fmi3OK;
}
