"""What a mechanism is before it moves: equilibrium, linear model, modes, branches."""
