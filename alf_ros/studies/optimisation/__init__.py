"""Numbers of a scene that minimise an output of its motion, with exact gradients."""
