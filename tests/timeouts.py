"""How long tests wait for other processes: so much longer than any takes that only what hangs is given up."""

import time

#: A process that starts in a second takes fifteen on a slow machine that is busy; beyond this it
#: hangs, s.
TIMEOUT = 240.0


def wait_until(holds):
    """Wait until something holds."""
    deadline = time.monotonic() + TIMEOUT
    while not holds():
        assert time.monotonic() < deadline, "What was waited for did not come"
        time.sleep(0.02)
