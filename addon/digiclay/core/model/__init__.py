"""Continuous model: bed, fluid, supply, valve, cylinder, fingertip, pulp, sensors; their interfaces."""
