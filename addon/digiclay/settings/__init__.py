"""Settings of a bed: every parameter of the core as a Blender property."""
