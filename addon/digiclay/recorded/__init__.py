"""Takes and bakes: what is kept of a session besides its state."""
