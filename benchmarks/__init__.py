"""What a session costs, how exact it is, and what it withstands: `python -m benchmarks`, from a checkout."""
