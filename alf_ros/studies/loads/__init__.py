"""Loads of a given motion: efforts of chosen actuators, reactions, and the fastest run."""
