"""Takes, bakes, and recorded strokes."""
