"""Press strokes: their path, and the motion of the fingertip along it; no Blender."""
