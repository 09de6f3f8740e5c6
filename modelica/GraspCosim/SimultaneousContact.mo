within GraspCosim;
block SimultaneousContact "Layer 3: a target at which both fingers arrive together, Eq. (2) to (4)"
  extends Interfaces.Block;
  parameter Boolean enabled = true "Off: the target is the middle of the fingers";
  parameter Types.Mass mass = 1 "M_a2";
  parameter Types.Damping damping = 12 "D_a2";
  parameter Types.Stiffness stiffness = 36 "K_a2";
  parameter Types.Force gain = 3 "K_s";
  Interfaces.RealInput position[2](each unit = "m") "x_j"
    annotation (Placement(transformation(extent = {{-120, 40}, {-100, 60}})));
  Interfaces.RealInput intensity[2](each unit = "V") "xi_j"
    annotation (Placement(transformation(extent = {{-120, -60}, {-100, -40}})));
  Interfaces.RealOutput target_position(unit = "m") "x_v2"
    annotation (Placement(transformation(extent = {{100, 40}, {120, 60}})));
  Interfaces.RealOutput target_velocity(unit = "m/s") "x_v2'"
    annotation (Placement(transformation(extent = {{100, -60}, {120, -40}})));
  Interfaces.RealOutput simultaneous_contact_force(unit = "N") "f_s"
    annotation (Placement(transformation(extent = {{100, -100}, {120, -80}})));
protected
  Types.Length middle "x_d";
  Types.Length x "x_v2 of the layer that is on";
  Types.Velocity v(start = 0, fixed = true) "Its velocity";
  Types.Voltage total "Light of both fingers";
initial equation
  x = middle;
equation
  total = noEvent(max(0, intensity[1]) + max(0, intensity[2]));
  simultaneous_contact_force = gain*noEvent(if total > 0
    then tanh((max(0, intensity[1]) - max(0, intensity[2]))/total) else 0) "Eq. (2)";
  der(x) = v;
  mass*der(v) + damping*v + stiffness*(x - middle) = simultaneous_contact_force "Eq. (3)";
  middle = (position[1] + position[2])/2 "Eq. (4); its rates count as 0";
  target_position = if enabled then x else middle;
  target_velocity = if enabled then v else 0;
  annotation (Documentation(info = "<html>
<p>(2): f_s = K_s tanh((xi_1 - xi_2)/(xi_1 + xi_2))</p>
<p>(3): M_a2 x_v2'' + D_a2 x_v2' + K_a2 (x_v2 - x_d) = f_s</p>
<p>(4): x_d = (x_1 + x_2)/2, x_d' = x_d'' = 0</p>
</html>"));
end SimultaneousContact;
