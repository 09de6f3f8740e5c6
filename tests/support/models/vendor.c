/* The gripper plant of another vendor, FMI 3.0: mm, mm/s and mN, both gaps as one array.
 *
 * The equations are those of GripperPlant as C.
 */
#include "GripperPlant.h"

enum { TIME, FORCE_RIGHT, FORCE_LEFT, BRAKE, GAPS = 10, TIP_RIGHT, TIP_LEFT, SPEED_RIGHT, SPEED_LEFT,
       LOAD_RIGHT, LOAD_LEFT, PART, TOUCH_RIGHT = 20, TOUCH_LEFT, START = 30, VARIABLES };
#define LARGEST 2
#define SIZE(r) ((r) == GAPS ? 2 : 1)
#define STATES 0
#define OWN GripperPlant_State x; GripperPlant_Parameters p; GripperPlant_Inputs u;
#define OWN_STEPS
#define INPUT(r) ((r) <= BRAKE)
#include "model.h"

static void start(Model *m) {
    static const GripperPlant_Parameters P = GRIPPERPLANT_PARAMETERS_DEFAULTS;
    m->p = P;
    *real(m, START) = 1e3 * P.initial_object_position;
}

static void equations(Model *m) {
    GripperPlant_Outputs y;

    m->u.force_1 = *real(m, FORCE_RIGHT) / 1e3;
    m->u.force_2 = *real(m, FORCE_LEFT) / 1e3;
    m->p.initial_object_position = *real(m, START) / 1e3;
    if (m->mode < EVENT) GripperPlant_initial_state(&m->p, &m->u, &m->x, &y, NULL);
    GripperPlant_outputs(&m->p, &m->u, &m->x, &y, NULL);
    *real(m, GAPS) = 1e3 * y.gap_1;
    m->v[GAPS][1].Float64 = 1e3 * y.gap_2;
    *real(m, TIP_RIGHT) = 1e3 * y.position_1;
    *real(m, TIP_LEFT) = 1e3 * y.position_2;
    *real(m, SPEED_RIGHT) = 1e3 * y.velocity_1;
    *real(m, SPEED_LEFT) = 1e3 * y.velocity_2;
    *real(m, LOAD_RIGHT) = 1e3 * y.contact_force_1;
    *real(m, LOAD_LEFT) = 1e3 * y.contact_force_2;
    *real(m, PART) = 1e3 * y.object_position;
    m->v[TOUCH_RIGHT]->Boolean = y.contact_1;
    m->v[TOUCH_LEFT]->Boolean = y.contact_2;
}

static void advance(Model *m, double end) {
    GripperPlant_Inputs u = m->u;
    GripperPlant_Outputs y;

    u.force_1 *= 1.0 - *real(m, BRAKE);
    u.force_2 *= 1.0 - *real(m, BRAKE);
    m->status = GripperPlant_step(&m->p, &u, end - m->time, &m->x, &y, NULL);
    set_time(m, end);
}

#include "fmi.c"
