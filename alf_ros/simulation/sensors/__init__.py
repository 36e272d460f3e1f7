"""Measurements of the sensors of a scene, from samples."""

from alf_ros.simulation.sensors.measuring import Measurement, Sensors

__all__ = ['Measurement', 'Sensors']
