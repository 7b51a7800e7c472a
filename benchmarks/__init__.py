"""Benchmarks of time, error and stability: `python -m benchmarks`, in a checkout."""
