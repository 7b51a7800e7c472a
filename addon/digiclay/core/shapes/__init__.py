"""Input shapes, fitted to a bed: height maps, meshes, arrays."""
