"""Formed surfaces: skins over the pins, solids, bosses and creases."""
