"""Batches: several runs in one call, with the run as the last array axis."""
