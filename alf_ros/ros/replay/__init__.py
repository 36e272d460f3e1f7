"""Logs published again."""
