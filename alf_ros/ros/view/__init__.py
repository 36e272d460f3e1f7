"""The live view in a web browser."""
