"""The cost of accuracy in time."""
