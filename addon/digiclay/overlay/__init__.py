"""Overlay of a live session: force, heights, modes, speed and error."""
