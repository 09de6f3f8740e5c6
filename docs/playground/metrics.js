// The metrics of a grasp, as grasp/metrics.py has them: from all rows, in SI units. A value per finger
// where they are a list; null where there is none.
"use strict";

const CLOSING = { 1: -1, 2: 1 };
const IMPACT = 0.02, STEADY = 0.1, SETTLED = 0.02; // s; s; share of the steady force

const FINGERS = [1, 2];

function largest(values) {
  let most = 0;
  for (const v of values) if (Math.abs(v) > most) most = Math.abs(v);
  return most;
}

function interpolated(t, times, values) {
  if (t <= times[0]) return values[0];
  const k = rowAt(times, t);
  if (k >= times.length) return values[values.length - 1];
  return times[k] === t ? values[k]
    : values[k - 1] + (values[k] - values[k - 1]) / (times[k] - times[k - 1]) * (t - times[k - 1]);
}

// As the plant tells it, also of a contact between two rows.
function firstContact(run, j) {
  const since = run.of("plant.first_contact_time", j), row = since.findIndex((t) => t >= 0);
  if (row < 0) return null;
  return { t: run.time[0] + since[row], speed: run.of("plant.impact_velocity", j)[row], row };
}

function settling(after, force, steady) {
  const end = after[after.length - 1] - STEADY;
  if (steady === null || !after.length || end < 0) return null;
  let k = force.length - 1;
  while (k >= 0 && !(Math.abs(force[k] - steady) > SETTLED * steady)) k--;
  if (k < 0) return 0;
  if (after[k] >= end) return null;
  const error = force[k] - steady, edge = Math.sign(error) * SETTLED * steady;
  return after[k] + (error - edge) / (force[k] - force[k + 1]) * (after[k + 1] - after[k]);
}

function drift(run) {
  const { time } = run, position = run.signal("plant.object_position"), n = time.length - 1;
  if (time[n] - time[0] < STEADY) return null;
  return Math.abs(position[n] - interpolated(time[n] - STEADY, time, position)) / STEADY;
}

// A run has time, signal(name) and of(name, finger), which are arrays of all rows.
function metricsOf(run) {
  const { time } = run, n = time.length - 1, last = (values) => values[n];
  const late = rowAt(time, time[n] - STEADY);
  const fingers = FINGERS.map((j) => {
    const contact = firstContact(run, j), gap = run.of("plant.gap", j);
    const force = run.of("plant.contact_force", j).map(Math.abs), held = force.subarray(late);
    const row = contact ? contact.row : n + 1;
    const after = time.subarray(row).map((t) => t - (contact ? contact.t : 0));
    const pressed = force.subarray(row), impulse = run.of("plant.contact_impulse", j).map(Math.abs);
    const average = (last(impulse) - impulse[late]) / (time[n] - time[late]);
    const steady = held.every((f) => f > 0) ? average : null;
    return {
      time_to_contact: contact && contact.t,
      remaining_gap: contact ? null : last(gap),
      smallest_gap: contact ? null : gap.reduce((a, b) => Math.min(a, b)),
      impact_velocity: contact && contact.speed > 0 ? contact.speed : null,
      impact_impulse: after[after.length - 1] >= IMPACT
        ? Math.abs(last(run.of("plant.impact_impulse", j))) : null,
      peak_contact_force: largest(force),
      steady_contact_force: average,
      force_overshoot: steady === null || !pressed.length
        ? null : Math.max(0, largest(pressed) / steady - 1),
      settling_time: settling(after, pressed, steady),
    };
  });
  const both = (name) => fingers.map((finger) => finger[name]);
  const apart = (name) => (both(name).includes(null)
    ? null : Math.abs(fingers[1][name] - fingers[0][name]));
  const object = run.signal("plant.object_position");
  const optional = (name, value) => (run.has(`plant.${name}`)
    ? { [value]: largest(run.signal(`plant.${name}`)) } : {});
  const found = {
    time_to_contact: both("time_to_contact"), time_difference: apart("time_to_contact"),
    remaining_gap: both("remaining_gap"), smallest_gap: both("smallest_gap"),
    impact_velocity: both("impact_velocity"), impact_impulse: both("impact_impulse"),
    peak_contact_force: both("peak_contact_force"),
    steady_contact_force: both("steady_contact_force"),
    force_difference: apart("steady_contact_force"),
    force_overshoot: both("force_overshoot"), settling_time: both("settling_time"),
    target_position: last(run.signal("controller.target_position")),
    object_shift: largest(object.map((x) => x - object[0])), object_drift: drift(run),
    ...optional("tilt", "object_tilt"), ...optional("toppled", "toppled"),
    ...optional("squeeze", "squeeze"), ...optional("damaged", "damaged"),
  };
  for (const name of ["toppled", "damaged"]) if (name in found) found[name] = found[name] > 0;
  return found;
}
