"""Models fitted to recordings: numbers of a scene from the motions of a machine."""
