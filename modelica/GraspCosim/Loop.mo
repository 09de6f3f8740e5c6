within GraspCosim;
model Loop "Plant, two sensors and controller; Case 2 of the paper"
  replaceable Plant plant constrainedby Interfaces.PartialPlant "Two fingers and an object"
    annotation (Placement(transformation(extent = {{-80, -20}, {-40, 20}})));
  Sensor sensor_1 "On finger 1, the right one"
    annotation (Placement(transformation(extent = {{-10, -30}, {10, -10}})));
  Sensor sensor_2 "On finger 2"
    annotation (Placement(transformation(extent = {{-10, -70}, {10, -50}})));
  Controller controller "Three layers"
    annotation (Placement(transformation(extent = {{40, -20}, {80, 20}})));
equation
  connect(plant.gap[1], sensor_1.gap)
    annotation (Line(points = {{-38, 4}, {-26, 4}, {-26, -20}, {-11, -20}}, color = {0, 0, 127}));
  connect(plant.gap[2], sensor_2.gap)
    annotation (Line(points = {{-38, 4}, {-26, 4}, {-26, -60}, {-11, -60}}, color = {0, 0, 127}));
  connect(plant.position, controller.position)
    annotation (Line(points = {{-38, 16}, {0, 16}, {0, 12}, {38, 12}}, color = {0, 0, 127}));
  connect(plant.velocity, controller.velocity)
    annotation (Line(points = {{-38, 10}, {20, 10}, {20, 0}, {38, 0}}, color = {0, 0, 127}));
  connect(sensor_1.intensity, controller.intensity[1])
    annotation (Line(points = {{11, -20}, {26, -20}, {26, -12}, {38, -12}}, color = {0, 0, 127}));
  connect(sensor_2.intensity, controller.intensity[2])
    annotation (Line(points = {{11, -60}, {26, -60}, {26, -12}, {38, -12}}, color = {0, 0, 127}));
  connect(controller.force, plant.force)
    annotation (Line(color = {0, 0, 127},
      points = {{82, 0}, {92, 0}, {92, 60}, {-92, 60}, {-92, 0}, {-82, 0}}));
  annotation (
    Documentation(info = "<html>
<p>The controller closes the loop. Another object is a modification:
Loop(redeclare PlantMovable plant). So is another place of it:
Loop(plant(initial_object_position = 0)).</p>
</html>"),
    experiment(StopTime = 3, Interval = 1e-3, Tolerance = 1e-8));
end Loop;
