"""Plots of runs, sweeps and benchmarks, with matplotlib."""
