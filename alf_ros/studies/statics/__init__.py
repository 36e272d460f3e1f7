"""Properties of a mechanism before it moves: equilibrium, linear model, modes."""
