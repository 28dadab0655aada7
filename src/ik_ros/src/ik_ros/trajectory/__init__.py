"""Parts of the solver `trajectory`: a spline for each joint, and the nonlinear program that shapes them."""
