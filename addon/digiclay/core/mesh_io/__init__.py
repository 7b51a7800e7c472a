"""Mesh files: writers and readers, one file a format."""
