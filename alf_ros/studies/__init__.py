"""Accuracy against exact motions, cost against accuracy, the figures of the paper."""
