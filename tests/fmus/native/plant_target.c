/* The gripper plant on a target: gripper_plant/rigid.py and contact.py, in C.
 *
 *   plant_target PORT [KEY_FILE|- [PERIOD]]    prints "listening on PORT"; PORT 0 takes a free one
 *
 * The same operations in the same order, so the same bits: compile without contraction to fused
 * operations (-std=c99 has gcc not do it) and link with -lm.
 */
#define GRIPPER_PLANT_EXAMPLE_MAIN
#include "gripper_plant.h"

#include <math.h>

#define SUBSTEP_RATIO 0.1

typedef struct {
    double s, v, contact_force;
} Finger;

static Finger right, left;

static double at_least_zero(double value)
{
    return value > 0.0 ? value : 0.0;
}

static long substeps(double alpha, double beta, double h)
{
    double fastest = 2.0 * alpha > beta ? 2.0 * alpha : beta;
    double n = ceil(h * fastest / SUBSTEP_RATIO - 1e-9);
    return n > 1.0 ? (long)n : 1;
}

static double time_to_contact(double gap, double rate, double acceleration)
{
    double discriminant;
    if (gap < 0.0 || (gap == 0.0 && (rate < 0.0 || (rate == 0.0 && acceleration <= 0.0))))
        return 0.0;
    discriminant = rate * rate - 2.0 * acceleration * gap;
    if (discriminant < 0.0)
        return HUGE_VAL;
    if (rate < 0.0)
        return 2.0 * gap / (sqrt(discriminant) - rate);
    return acceleration < 0.0 ? (sqrt(discriminant) + rate) / -acceleration : HUGE_VAL;
}

static Finger fly(double s, double v, double acceleration, double d)
{
    Finger after = {0.0, v + acceleration * d, 0.0};
    after.s = s + 0.5 * d * (v + after.v);
    return after;
}

static Finger leave(double depth, double v, double acceleration, double surface, double m, double f,
                    double d)
{
    double leaving = sqrt(at_least_zero(v * v + 2.0 * acceleration * depth));
    double rest = d - (depth > 0.0 ? 2.0 * depth / (v + leaving) : 0.0);
    if (time_to_contact(0.0, leaving, f / m) < rest) {
        Finger stays = {surface, 0.0, at_least_zero(-f)};
        return stays;
    }
    return fly(surface, leaving, f / m, rest);
}

static Finger touch(double s, double v, double surface, double m, double f, double alpha,
                    double beta, double d)
{
    double constrained = -(2.0 * alpha * v + beta * beta * (s - surface + 0.5 * d * v)) /
                         (1.0 + alpha * d + 0.25 * beta * beta * d * d);
    double contact_force = at_least_zero(m * constrained - f);
    double acceleration = (f + contact_force) / m;
    Finger after = fly(s, v, acceleration, d);
    if (after.s > surface)
        return leave(surface - s, v, acceleration, surface, m, f, d);
    after.contact_force = contact_force;
    return after;
}

static Finger advance(double s, double v, double surface, double m, double f, double alpha,
                      double beta, double h)
{
    Finger finger = {s, v, 0.0};
    long n = substeps(alpha, beta, h);
    double d = h / (double)n, free_time;
    if (time_to_contact(s - surface, v, f / m) >= h)
        return fly(s, v, f / m, h);
    while (n--) {
        free_time = time_to_contact(finger.s - surface, finger.v, f / m);
        if (free_time >= d) {
            finger = fly(finger.s, finger.v, f / m, d);
            continue;
        }
        if (free_time > 0.0) {
            finger.v = fly(finger.s, finger.v, f / m, free_time).v;
            finger.s = surface;
        }
        finger = touch(finger.s, finger.v, surface, m, f, alpha, beta, d - free_time);
    }
    return finger;
}

/* Where the object begins for the right finger and for the left, each in its opening direction. */
static double right_surface(const gripper_plant_parameters *p)
{
    return 0.5 * p->object_width + p->initial_object_position;
}

static double left_surface(const gripper_plant_parameters *p)
{
    return 0.5 * p->object_width - p->initial_object_position;
}

static void put_outputs(const gripper_plant_parameters *p, gripper_plant_outputs *y)
{
    y->position_1 = right.s;
    y->position_2 = -left.s;
    y->velocity_1 = right.v;
    y->velocity_2 = 0.0 - left.v;
    y->gap_1 = right.s - right_surface(p);
    y->gap_2 = left.s - left_surface(p);
    y->contact_force_1 = right.contact_force;
    y->contact_force_2 = 0.0 - left.contact_force;
    y->contact_1 = y->gap_1 <= 0.0;
    y->contact_2 = y->gap_2 <= 0.0;
    y->object_position = p->initial_object_position;
}

const char *gripper_plant_initialise(double time, const gripper_plant_inputs *u,
                                     const gripper_plant_parameters *p, gripper_plant_outputs *y)
{
    Finger at_rest = {0.0, 0.0, 0.0};
    (void)time, (void)u;
    if (!(p->finger_mass_1 > 0.0 && p->finger_mass_2 > 0.0))
        return "finger_mass: must be over 0 kg";
    right = left = at_rest;
    right.s = p->initial_position_1;
    left.s = -p->initial_position_2;
    put_outputs(p, y);
    return NULL;
}

const char *gripper_plant_step(double time, double step, const gripper_plant_inputs *u,
                               const gripper_plant_parameters *p, gripper_plant_outputs *y)
{
    double alpha = p->baumgarte_alpha, beta = p->baumgarte_beta;
    (void)time;
    right = advance(right.s, right.v, right_surface(p), p->finger_mass_1, u->force_1, alpha, beta,
                    step);
    /* -(0.0 - v): through the outputs and back, which makes -0.0 of 0.0 */
    left = advance(left.s, -(0.0 - left.v), left_surface(p), p->finger_mass_2, -u->force_2, alpha,
                   beta, step);
    put_outputs(p, y);
    return NULL;
}

void gripper_plant_make_safe(gripper_plant_inputs *u)
{
    u->force_1 = u->force_2 = 0.0;
    fprintf(stderr, "safe\n");
}
