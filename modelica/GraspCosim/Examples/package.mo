within GraspCosim;
package Examples "Cases of the paper, and other objects"
end Examples;
