"""Mechanisms through their singular positions, judged against exact motions."""
