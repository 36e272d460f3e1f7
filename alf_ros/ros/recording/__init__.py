"""Logs written as MCAP."""
