"""Many sessions in one call: the arrays of a session with one axis more, the last, for the runs.

A number that differs from run to run is an array (b,). Numpy puts it against the last axis, so most formulas
of a single session hold as they stand; and an array (r, w, b) is one of (r, w b) for whatever treats
each cell by itself, the steppers above all.
"""
