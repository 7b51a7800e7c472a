"""Sessions that run: the loop, its ticks, and what the .blend keeps of them."""
