"""Stills, turntables and films, drawn from recorded states."""
