"""The overlay of a running session: force, heights, modes, speed and error."""
