within GraspCosim;
model PlantMovable "Two fingers and a box that slides on a floor"
  extends Interfaces.PartialPlant;
  parameter Types.Mass object_mass = 0.05 "m, mass of the object";
  parameter Types.Ratio floor_friction = 0.3 "mu, friction of the object on the floor";
  parameter Types.Velocity creep_velocity = 1e-4 "Speed at which friction of the floor is full";
  parameter Interfaces.KelvinVoigt kelvin_voigt "Surface of the box";
  parameter Types.Acceleration gravity = 9.80665 "g";
protected
  Types.Length shift(start = 0, fixed = true) "Way of the box";
  Types.Velocity drift(start = 0, fixed = true) "Speed of the box";
  Types.Length depth[2] "By which a finger has sunk in";
  Types.Velocity rate[2] "At which it sinks in";
  Types.Force floor_force "F_f, force of the floor on the box";
equation
  object_position = initial_object_position + shift;
  der(shift) = drift;
  object_mass*der(drift) = floor_force - contact_force[1] - contact_force[2] "(B1), flat";
  floor_force = -floor_friction*object_mass*gravity*noEvent(max(-1, min(1, drift/creep_velocity)));
  depth[1] = object_position + object_width/2 - position[1];
  depth[2] = position[2] - object_position + object_width/2;
  rate[1] = drift - velocity[1];
  rate[2] = velocity[2] - drift;
  contact_force[1] = noEvent(if depth[1] > 0
    then max(0, kelvin_voigt.stiffness*depth[1] + kelvin_voigt.damping*rate[1]) else 0)
    "Kelvin-Voigt";
  contact_force[2] = noEvent(if depth[2] > 0
    then -max(0, kelvin_voigt.stiffness*depth[2] + kelvin_voigt.damping*rate[2]) else 0)
    "Kelvin-Voigt";
  for j in 1:2 loop
    gap[j] = noEvent(max(0, -depth[j]));
  end for;
  annotation (Documentation(info = "<html>
<p>(B1) of a box that is flat: m p'' = F + F_f, |F_f| &lt;= mu m g. F is the sum of the pushes.</p>
<p>At rest the floor holds by a creep below creep_velocity. The box does not tilt: that holds while
mu is below W/H, and the fingertips are not above half the height H.</p>
</html>"));
end PlantMovable;
