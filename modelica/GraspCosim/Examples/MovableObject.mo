within GraspCosim.Examples;
model MovableObject "All three layers and a box that slides"
  extends Loop(redeclare PlantMovable plant);
  annotation (experiment(StopTime = 3, Interval = 1e-3, Tolerance = 1e-8));
end MovableObject;
