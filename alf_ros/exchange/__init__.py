"""Other formats in and out: URDF, MJCF."""
