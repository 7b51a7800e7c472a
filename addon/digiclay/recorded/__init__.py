"""Takes and bakes."""
