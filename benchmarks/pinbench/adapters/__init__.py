"""Adapters: each a file with METHODS and `prepare`; see ../../README.md."""
