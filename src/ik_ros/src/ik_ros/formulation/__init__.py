"""Parts of the solver `tasks`: robot, tasks, Gauss-Newton steps."""
