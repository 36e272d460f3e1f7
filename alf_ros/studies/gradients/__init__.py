"""Gradients of a run: what a number of its motion changes by with numbers of its scene."""
