"""Options of series: where their bundles are evaluated, and the members of an uncertainty."""

from pathlib import Path

from ..core.base.errors import DigiclayError
from ..core.metrics.bands import LEAST, MEMBERS, MOST
from .arguments import Options, one_of, whole_number
from .refusals import in_blender, refuse_without

#: The most processes of a command.
MOST_PROCESSES = 61
#: Reads a number of processes.
read_count = whole_number(1, MOST_PROCESSES)


def _read_address(text: str) -> str:
    """Return the address of a scheduler; refuse it without Dask, before any work."""
    if in_blender():
        raise DigiclayError(
            "--scheduler is not for the extension: run 'digiclay' outside of Blender."
        )
    refuse_without("--scheduler", "cluster", "distributed")
    return text


#: Options of which one says where bundles are evaluated.
PLACES: Options = {
    "--workers N": (read_count, "number of processes; default: one per core"),
    "--scheduler ADDRESS": (_read_address, "a Dask cluster instead, such as tcp://127.0.0.1:8786"),
}
add_pool = one_of(PLACES)

#: Options of the uncertainty of fitted parameters.
UNCERTAIN: Options = {
    "--uncertain FILE": {
        "type": Path,
        "action": "append",
        "default": [],
        "help": "take the parts of a fitted file, and add bands of 95 %% over its intervals",
    },
    "--members N": (whole_number(LEAST, MOST), f"runs for them; default: {MEMBERS}", MEMBERS),
    "--speed": "with --uncertain: bands of the largest tracking speeds, too",
    "--seed N": (whole_number(1, 2**31), "of their random numbers; default: 1", 1),
}
