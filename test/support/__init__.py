"""Shared parts of the tests: mechanisms, processes, readers and paths."""
