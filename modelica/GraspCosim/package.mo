package GraspCosim "A delicate grasp: two fingers, proximity sensors, three impedances in series"
  annotation (
    version = "0.1.0",
    Documentation(info = "<html>
<p>The grasp of grasp-cosim as equations. Simulate <a href=\"modelica://GraspCosim.Examples.Case2\">
Examples.Case2</a>, or exchange one block of <a href=\"modelica://GraspCosim.Loop\">Loop</a>.</p>
<p>Signs: the x axis is fixed to the wrist and points right. Finger 1 is the right one. To close,
force[1] &lt; 0 and force[2] &gt; 0. The object pushes back with contact_force[1] &gt;= 0 and
contact_force[2] &lt;= 0.</p>
<p>Numbers of equations are those of the paper, letters those of the equation sheets in the folders
plant, sensor and controller. No other library is needed.</p>
</html>"),
    Icon(coordinateSystem(extent = {{-100, -100}, {100, 100}}), graphics = {
      Rectangle(extent = {{-30, 30}, {30, -60}}, fillColor = {210, 210, 210},
        fillPattern = FillPattern.Solid),
      Rectangle(extent = {{45, 60}, {65, -60}}, fillColor = {0, 90, 160},
        fillPattern = FillPattern.Solid),
      Rectangle(extent = {{-65, 60}, {-45, -60}}, fillColor = {0, 90, 160},
        fillPattern = FillPattern.Solid)}));
end GraspCosim;
