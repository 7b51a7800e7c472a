"""Shape input and mesh output in Blender."""
