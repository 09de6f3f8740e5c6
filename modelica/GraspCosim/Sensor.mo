within GraspCosim;
block Sensor "Reflected light of one finger, Eq. (9)"
  extends Interfaces.Block;
  parameter Types.Ratio reflectance = 1 "alpha, relative to white";
  parameter Real gain = 0.0024 "K, of a white surface, in V.m^n";
  parameter Types.Exponent diffusion_exponent = 1.1506 "n";
  parameter Types.Length offset_distance = 0.005 "l_0, from the sensor face to its element";
  Interfaces.RealInput gap(unit = "m", start = 0.1) "l, distance to the object surface"
    annotation (Placement(transformation(extent = {{-120, -10}, {-100, 10}})));
  Interfaces.RealOutput intensity(unit = "V") "xi, offset-compensated"
    annotation (Placement(transformation(extent = {{100, -10}, {120, 10}})));
equation
  intensity = gain*reflectance/(noEvent(max(0, gap)) + offset_distance)^diffusion_exponent
    "Eq. (9)";
  annotation (Documentation(info = "<html>
<p>(9): xi = K alpha / (l + l_0)^n. A spacer keeps the object off the element.</p>
</html>"));
end Sensor;
