"""Motions known exactly, or far more exactly than any integrator here steps them."""
