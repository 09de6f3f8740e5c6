within GraspCosim.Examples;
model Case1 "Contact force control and impact reduction"
  extends Loop(controller(simultaneous_contact(enabled = false)));
  annotation (experiment(StopTime = 3, Interval = 1e-3, Tolerance = 1e-8));
end Case1;
