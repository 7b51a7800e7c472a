"""The counterparts of the paper's Figs. 3 to 10, and its claims set beside what is measured."""
