"""Problems in the XML of EXOTica, expressed by the tasks of the solver `tasks`."""
