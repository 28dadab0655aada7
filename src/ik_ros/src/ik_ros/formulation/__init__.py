"""What a formulation of the solver `tasks` stands on."""
