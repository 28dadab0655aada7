"""Problems in the XML of EXOTica, expressed as tasks of the solver `tasks`."""
