within GraspCosim;
block ImpactReduction "Layer 2: brakes a finger more, the nearer the surface is, Eq. (5) and (6)"
  extends Interfaces.Block;
  parameter Boolean enabled = true "Off: the virtual objects are the target";
  parameter Types.Mass mass = 1 "M_a1";
  parameter Types.Damping damping = 10 "D_a1";
  parameter Types.Stiffness stiffness = 25 "K_a1";
  parameter Types.Impulse viscosity[2] = {0.6, -0.6} "D_pj";
  parameter Types.Voltage intensity_floor = 1e-6 "Below it the sensor sees nothing";
  Interfaces.RealInput position[2](each unit = "m") "x_j, where the virtual objects start"
    annotation (Placement(transformation(extent = {{-120, 70}, {-100, 90}})));
  Interfaces.RealInput intensity[2](each unit = "V") "xi_j"
    annotation (Placement(transformation(extent = {{-120, 30}, {-100, 50}})));
  Interfaces.RealInput target_position(unit = "m") "x_v2"
    annotation (Placement(transformation(extent = {{-120, -50}, {-100, -30}})));
  Interfaces.RealInput target_velocity(unit = "m/s") "x_v2'"
    annotation (Placement(transformation(extent = {{-120, -90}, {-100, -70}})));
  Interfaces.RealOutput virtual_position[2](each unit = "m") "x_vj1"
    annotation (Placement(transformation(extent = {{100, 40}, {120, 60}})));
  Interfaces.RealOutput virtual_velocity[2](each unit = "m/s") "x_vj1'"
    annotation (Placement(transformation(extent = {{100, -60}, {120, -40}})));
protected
  Types.Length x[2] "x_vj1 of the layer that is on";
  Types.Velocity v[2] "Their velocities";
  Types.Impulse braked[2] "Momentum relative to the target, less the impulse of f_pj";
  Types.Impulse light[2] "Impulse of f_pj, but for a constant: the integral of (5)";
initial equation
  for j in 1:2 loop
    x[j] = position[j];
    braked[j] = -light[j] "At rest, as the target is";
  end for;
equation
  for j in 1:2 loop
    der(x[j]) = v[j];
    light[j] = viscosity[j]*log(noEvent(max(1, intensity[j]/intensity_floor)))
      "Eq. (5), integrated";
    mass*(v[j] - target_velocity) = braked[j] + light[j];
    der(braked[j]) = -damping*(v[j] - target_velocity) - stiffness*(x[j] - target_position)
      "Eq. (6) with (5), integrated: f_pj is the rate of the impulse";
    virtual_position[j] = if enabled then x[j] else target_position;
    virtual_velocity[j] = if enabled then v[j] else target_velocity;
  end for;
  annotation (Documentation(info = "<html>
<p>(5): f_pj = D_pj xi_j'/xi_j</p>
<p>(6): M_a1 (x_vj1'' - x_v2'') + D_a1 (x_vj1' - x_v2') + K_a1 (x_vj1 - x_v2) = f_pj</p>
<p>xi'/xi is the rate of ln xi. So (6) is integrated once, and nothing is differentiated.</p>
</html>"));
end ImpactReduction;
