"""Stills, turntables and films from recorded states."""
