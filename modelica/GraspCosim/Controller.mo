within GraspCosim;
block Controller "The three layers in series, from approach to grasp without switching"
  extends Interfaces.Block;
  Interfaces.RealInput position[2](each unit = "m") "x_j"
    annotation (Placement(transformation(extent = {{-120, 50}, {-100, 70}})));
  Interfaces.RealInput velocity[2](each unit = "m/s") "x_j'"
    annotation (Placement(transformation(extent = {{-120, -10}, {-100, 10}})));
  Interfaces.RealInput intensity[2](each unit = "V") "xi_j"
    annotation (Placement(transformation(extent = {{-120, -70}, {-100, -50}})));
  Interfaces.RealOutput force[2](each unit = "N") "u_j"
    annotation (Placement(transformation(extent = {{100, -10}, {120, 10}})));
  Interfaces.RealOutput target_position(unit = "m") "x_v2"
    annotation (Placement(transformation(extent = {{100, 50}, {120, 70}})));
  Interfaces.RealOutput virtual_position[2](each unit = "m") "x_vj1"
    annotation (Placement(transformation(extent = {{100, 80}, {120, 100}})));
  Interfaces.RealOutput simultaneous_contact_force(unit = "N") "f_s"
    annotation (Placement(transformation(extent = {{100, -70}, {120, -50}})));
  SimultaneousContact simultaneous_contact "Layer 3"
    annotation (Placement(transformation(extent = {{-80, -20}, {-40, 20}})));
  ImpactReduction impact_reduction "Layer 2"
    annotation (Placement(transformation(extent = {{-20, -20}, {20, 20}})));
  ContactForce contact_force "Layer 1"
    annotation (Placement(transformation(extent = {{40, -20}, {80, 20}})));
equation
  connect(position, simultaneous_contact.position)
    annotation (Line(points = {{-110, 60}, {-90, 60}, {-90, 10}, {-82, 10}}, color = {0, 0, 127}));
  connect(intensity, simultaneous_contact.intensity)
    annotation (Line(color = {0, 0, 127},
      points = {{-110, -60}, {-90, -60}, {-90, -10}, {-82, -10}}));
  connect(position, impact_reduction.position)
    annotation (Line(points = {{-110, 60}, {-30, 60}, {-30, 16}, {-22, 16}}, color = {0, 0, 127}));
  connect(intensity, impact_reduction.intensity)
    annotation (Line(points = {{-110, -60}, {-26, -60}, {-26, 8}, {-22, 8}}, color = {0, 0, 127}));
  connect(simultaneous_contact.target_position, impact_reduction.target_position)
    annotation (Line(points = {{-38, 10}, {-34, 10}, {-34, -8}, {-22, -8}}, color = {0, 0, 127}));
  connect(simultaneous_contact.target_velocity, impact_reduction.target_velocity)
    annotation (Line(color = {0, 0, 127},
      points = {{-38, -10}, {-30, -10}, {-30, -16}, {-22, -16}}));
  connect(position, contact_force.position)
    annotation (Line(points = {{-110, 60}, {30, 60}, {30, 16}, {38, 16}}, color = {0, 0, 127}));
  connect(velocity, contact_force.velocity)
    annotation (Line(color = {0, 0, 127},
      points = {{-110, 0}, {-94, 0}, {-94, 40}, {26, 40}, {26, 8}, {38, 8}}));
  connect(impact_reduction.virtual_position, contact_force.virtual_position)
    annotation (Line(points = {{22, 10}, {30, 10}, {30, -8}, {38, -8}}, color = {0, 0, 127}));
  connect(impact_reduction.virtual_velocity, contact_force.virtual_velocity)
    annotation (Line(points = {{22, -10}, {26, -10}, {26, -16}, {38, -16}}, color = {0, 0, 127}));
  connect(contact_force.force, force)
    annotation (Line(points = {{82, 0}, {110, 0}}, color = {0, 0, 127}));
  connect(simultaneous_contact.target_position, target_position)
    annotation (Line(color = {0, 0, 127},
      points = {{-38, 10}, {-34, 10}, {-34, 70}, {90, 70}, {90, 60}, {110, 60}}));
  connect(impact_reduction.virtual_position, virtual_position)
    annotation (Line(points = {{22, 10}, {22, 90}, {110, 90}}, color = {0, 0, 127}));
  connect(simultaneous_contact.simultaneous_contact_force, simultaneous_contact_force)
    annotation (Line(color = {0, 0, 127},
      points = {{-38, -18}, {-38, -70}, {90, -70}, {90, -60}, {110, -60}}));
  annotation (Documentation(info = "<html>
<p>Case 2 has all layers, Case 1 layer 3 off, Case 0 layer 2 off too.</p>
</html>"));
end Controller;
