"""Fit of device and finger to measured data, and design of the measurement; needs SciPy."""
