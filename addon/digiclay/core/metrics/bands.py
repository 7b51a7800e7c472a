"""Bands of 95 % of metrics over the members of an uncertainty."""

from collections.abc import Sequence

import numpy as np

#: Members by default, with which the width of a band is off by 7 % (standard deviation; four times as
#: many halve it); the fewest, of which one is beyond each end of a band; the most.
MEMBERS, LEAST, MOST = 100, 40, 1000
#: Ends of a 95 % band.
ENDS = 0.025, 0.975


def find_band(values: Sequence[float]) -> list[float]:
    """Return both ends of the 95 % band of members' values, or none of fewer than `LEAST`.

    One more member is in it with a probability of 95 %, whatever the distribution.
    """
    if len(values) < LEAST:
        return []
    ends: list[float] = np.quantile(values, ENDS, method="weibull").tolist()
    return ends
