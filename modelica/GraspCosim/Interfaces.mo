within GraspCosim;
package Interfaces "Connectors, and what classes have in common"

  connector RealInput = input Real "Signal that enters a block"
    annotation (Icon(graphics = {Polygon(points = {{-100, 100}, {100, 0}, {-100, -100}},
      lineColor = {0, 0, 127}, fillColor = {0, 0, 127}, fillPattern = FillPattern.Solid)}));

  connector RealOutput = output Real "Signal that leaves a block"
    annotation (Icon(graphics = {Polygon(points = {{-100, 100}, {100, 0}, {-100, -100}},
      lineColor = {0, 0, 127}, fillColor = {255, 255, 255}, fillPattern = FillPattern.Solid)}));

  partial model PartialPlant "Two fingers, Eq. (1); a model that extends it adds the object"
    parameter Types.Mass finger_mass[2] = {0.5, 0.5} "m_j, mass of the finger";
    parameter Types.Length initial_position[2] = {0.11, -0.11} "x_init,j, fingertip at the start";
    parameter Types.Length object_width = 0.07 "W, width of the object";
    parameter Types.Length initial_object_position = 0.03 "x_m, centre of the object at the start";
    RealInput force[2](each unit = "N", each start = 0) "u_j, force of the actuator on the finger"
      annotation (Placement(transformation(extent = {{-120, -10}, {-100, 10}})));
    RealOutput position[2](each unit = "m") "x_j, position of the fingertip"
      annotation (Placement(transformation(extent = {{100, 70}, {120, 90}})));
    RealOutput velocity[2](each unit = "m/s") "x_j', velocity of the fingertip"
      annotation (Placement(transformation(extent = {{100, 40}, {120, 60}})));
    RealOutput gap[2](each unit = "m") "l_j, distance from the sensor face to the object surface"
      annotation (Placement(transformation(extent = {{100, 10}, {120, 30}})));
    RealOutput contact_force[2](each unit = "N") "f_cj, force of the object on the finger"
      annotation (Placement(transformation(extent = {{100, -30}, {120, -10}})));
    RealOutput object_position(unit = "m") "Centre of the object"
      annotation (Placement(transformation(extent = {{100, -90}, {120, -70}})));
  protected
    Types.Length way[2](each start = 0, each fixed = true) "By which a finger has opened";
    Types.Velocity speed[2](each start = 0, each fixed = true) "At which a finger opens";
  equation
    der(way[1]) = speed[1];
    der(way[2]) = speed[2];
    finger_mass[1]*der(speed[1]) = force[1] + contact_force[1] "Eq. (1)";
    finger_mass[2]*der(speed[2]) = -(force[2] + contact_force[2]) "Eq. (1)";
    position[1] = initial_position[1] + way[1] "Finger 1 opens to the right";
    position[2] = initial_position[2] - way[2] "Finger 2 opens to the left";
    velocity[1] = speed[1];
    velocity[2] = -speed[2];
    annotation (Icon(coordinateSystem(extent = {{-100, -100}, {100, 100}}), graphics = {
      Rectangle(extent = {{-100, 100}, {100, -100}}),
      Rectangle(extent = {{-25, 25}, {25, -65}}, fillColor = {210, 210, 210},
        fillPattern = FillPattern.Solid),
      Rectangle(extent = {{45, 40}, {65, -65}}, fillColor = {0, 90, 160},
        fillPattern = FillPattern.Solid),
      Rectangle(extent = {{-65, 40}, {-45, -65}}, fillColor = {0, 90, 160},
        fillPattern = FillPattern.Solid),
      Text(extent = {{-150, 140}, {150, 105}}, textString = "%name")}));
  end PartialPlant;

  record KelvinVoigt "A surface that gives"
    parameter Types.Stiffness stiffness = 1e4 "k";
    parameter Types.Damping damping = 20 "c";
  end KelvinVoigt;

  partial block Block "A block with its name above"
    annotation (Icon(coordinateSystem(extent = {{-100, -100}, {100, 100}}), graphics = {
      Rectangle(extent = {{-100, 100}, {100, -100}}, fillColor = {255, 255, 255},
        fillPattern = FillPattern.Solid),
      Text(extent = {{-150, 140}, {150, 105}}, textString = "%name")}));
  end Block;
end Interfaces;
