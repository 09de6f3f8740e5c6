within GraspCosim.Examples;
model Case2 "All three layers: both fingers touch at the same time"
  extends Loop;
  annotation (experiment(StopTime = 3, Interval = 1e-3, Tolerance = 1e-8));
end Case2;
