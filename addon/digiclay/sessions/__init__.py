"""Live sessions as values, with their queues of press strokes; no Blender."""
