"""Metrics of a session, computed from its history or from sums over the cells."""
