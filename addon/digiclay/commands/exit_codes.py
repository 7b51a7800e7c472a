"""Exit codes of the commands."""

from __future__ import annotations

#: Some jobs of a batch failed; what the user asked for cannot be done; stopped by Ctrl-C or SIGTERM.
FAILED, WRONG, STOPPED = 1, 2, 130
