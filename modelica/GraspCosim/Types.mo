within GraspCosim;
package Types "Physical quantities in SI units"
  type Acceleration = Real(final quantity = "Acceleration", final unit = "m/s2");
  type Damping = Real(final quantity = "TranslationalDampingConstant", final unit = "N.s/m");
  type Exponent = Real(final unit = "1");
  type Force = Real(final quantity = "Force", final unit = "N");
  type Impulse = Real(final quantity = "Impulse", final unit = "N.s");
  type Length = Real(final quantity = "Length", final unit = "m");
  type Mass = Real(final quantity = "Mass", final unit = "kg", min = 1e-3);
  type Rate = Real(final quantity = "DampingCoefficient", final unit = "1/s");
  type Ratio = Real(final unit = "1");
  type Stiffness = Real(final quantity = "TranslationalSpringConstant", final unit = "N/m");
  type Velocity = Real(final quantity = "Velocity", final unit = "m/s");
  type Voltage = Real(final quantity = "ElectricPotential", final unit = "V");
  annotation (Documentation(info = "<html>
<p>As in Modelica.Units.SI, which is then not needed. Positions are of the type Length.</p>
</html>"));
end Types;
