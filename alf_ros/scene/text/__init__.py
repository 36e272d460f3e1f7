"""YAML with the line of each value, expressions, repetition, tables of numbers."""
