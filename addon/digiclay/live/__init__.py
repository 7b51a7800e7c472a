"""Live sessions: the loop, its ticks, and their data in the .blend."""
