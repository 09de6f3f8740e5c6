within GraspCosim.Examples;
model Case0 "Contact force control on its own"
  extends Loop(controller(
    simultaneous_contact(enabled = false),
    impact_reduction(enabled = false)));
  annotation (experiment(StopTime = 3, Interval = 1e-3, Tolerance = 1e-8));
end Case0;
