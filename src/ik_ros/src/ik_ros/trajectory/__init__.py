"""What the solver `trajectory` is made of: a spline for each joint, and the nonlinear program that shapes them."""
