within GraspCosim;
block ContactForce "Layer 1: an impedance from finger to virtual object, Eq. (7)"
  extends Interfaces.Block;
  parameter Types.Damping damping = 14 "D_i";
  parameter Types.Stiffness stiffness = 98 "K_i";
  Interfaces.RealInput position[2](each unit = "m") "x_j"
    annotation (Placement(transformation(extent = {{-120, 70}, {-100, 90}})));
  Interfaces.RealInput velocity[2](each unit = "m/s") "x_j'"
    annotation (Placement(transformation(extent = {{-120, 30}, {-100, 50}})));
  Interfaces.RealInput virtual_position[2](each unit = "m") "x_vj1"
    annotation (Placement(transformation(extent = {{-120, -50}, {-100, -30}})));
  Interfaces.RealInput virtual_velocity[2](each unit = "m/s") "x_vj1'"
    annotation (Placement(transformation(extent = {{-120, -90}, {-100, -70}})));
  Interfaces.RealOutput force[2](each unit = "N") "u_j"
    annotation (Placement(transformation(extent = {{100, -10}, {120, 10}})));
equation
  for j in 1:2 loop
    force[j] = -damping*(velocity[j] - virtual_velocity[j])
      - stiffness*(position[j] - virtual_position[j]) "Eq. (7)";
  end for;
  annotation (Documentation(info = "<html>
<p>(7): u_j = -D_i (x_j' - x_vj1') - K_i (x_j - x_vj1)</p>
</html>"));
end ContactForce;
