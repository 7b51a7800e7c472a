"""Scenes: value, table, file, and the system assembled from them."""
