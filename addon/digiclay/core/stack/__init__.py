"""Batches: several runs in one call, with the run as the last array axis.

A number that differs from run to run is an array (b,). Numpy puts it against the last axis, so most formulas
of a single session hold as they stand; and an array (r, w, b) is one of (r, w b) for whatever treats
each cell by itself, the steppers above all.
"""
