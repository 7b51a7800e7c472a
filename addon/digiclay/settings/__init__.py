"""The settings of a bed: every parameter of the core, as Blender's properties."""
