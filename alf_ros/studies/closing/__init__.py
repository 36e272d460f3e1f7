"""Closing the loops of a mechanism around given joint coordinates."""
