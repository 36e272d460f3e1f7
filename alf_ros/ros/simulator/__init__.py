"""The node that steps a simulation and publishes it."""
