"""Ensembles: many runs of one scene, each with other numbers, kept in a store that survives."""
