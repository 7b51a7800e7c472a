"""Shapes into the bed, and meshes out of it."""
