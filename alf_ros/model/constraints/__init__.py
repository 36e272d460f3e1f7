"""One file for each family of constraint rows, and how rows become arrays."""
