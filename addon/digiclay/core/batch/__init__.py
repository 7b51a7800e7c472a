"""Many sessions in one call: the last axis of every array is the run."""
