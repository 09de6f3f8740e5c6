within GraspCosim;
model Plant "Two fingers and a rigid, fixed object"
  extends Interfaces.PartialPlant;
  parameter Types.Rate baumgarte_alpha = 200 "alpha, damping rate of the contact";
  parameter Types.Rate baumgarte_beta = 200 "beta, natural rate of the contact";
  parameter Types.Length skin = 2e-7 "Depth over which the contact force sets in";
protected
  Types.Force pull[2] "Force of the actuator in the direction in which the finger opens";
  Types.Force push[2] "Of the constraint; below 0 it would hold the finger back";
equation
  object_position = initial_object_position;
  gap[1] = position[1] - object_position - object_width/2;
  gap[2] = object_position - object_width/2 - position[2];
  pull[1] = force[1];
  pull[2] = -force[2];
  for j in 1:2 loop
    push[j] = -pull[j]
      - finger_mass[j]*(2*baumgarte_alpha*speed[j] + baumgarte_beta^2*gap[j])
      "Eq. (1) with gap'' of (C1)";
  end for;
  contact_force[1] = noEvent(min(1, max(0, -gap[1])/skin)*max(0, push[1]));
  contact_force[2] = -noEvent(min(1, max(0, -gap[2])/skin)*max(0, push[2]));
  annotation (Documentation(info = "<html>
<p>(1): m_j x_j'' = u_j + f_cj</p>
<p>(C1), while the gap g is 0 or less, by a force that never pulls:
g'' + 2 alpha g' + beta^2 g = 0</p>
<p>The force sets in over the first 0.2 um. So the equations are continuous, no event is needed,
and a finger that is pressed rests at that depth.</p>
</html>"));
end Plant;
