"""State in, steps, Samples out."""
