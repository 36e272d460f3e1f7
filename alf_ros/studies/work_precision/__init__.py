"""What accuracy costs in time."""
