"""A mechanism as read-only arrays: constraint rows, mass, symbolic factor; closing it."""
