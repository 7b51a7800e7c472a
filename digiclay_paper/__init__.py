"""Reproduction of the paper: counterparts of its Figs. 3 to 10, and its claims beside measurements."""
