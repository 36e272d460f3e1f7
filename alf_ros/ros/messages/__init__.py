"""Samples as ROS messages."""
