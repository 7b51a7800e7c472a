"""Simulation of one control period: state, active set, order of the parts."""
