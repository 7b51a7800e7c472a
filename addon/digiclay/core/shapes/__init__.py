"""Shapes from outside, fitted to a bed: height maps, meshes, arrays."""
