"""Whole sessions: runs, error estimates, snapshots, takes, live periods."""
