"""Process of the doors: ``python -m digiclay_serve.door_process``, started by `doors`.

A process of its own: whatever clients do costs its time and its memory, not those of the session.
Its standard input has a line of settings, then an empty one per frame; it ends when that input
ends. Its output has a line of addresses, an empty one per order, and a line of counts.
"""

import asyncio
import json
import logging
import os
import sys
from contextlib import AsyncExitStack, suppress
from pathlib import Path

from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.files.tables import Record

from .door_link import DoorLink
from .doors import open_slot
from .osc_door import open_osc
from .protocol import Bed
from .websocket_door import open_websocket

#: Doors by the key of their port in the settings and in the answer.
DOORS = {"port": open_websocket, "osc_port": open_osc}

#: How much more readily the system is to give the processor to the session.
NICE = 5


def main() -> None:
    """Serve until the standard input ends."""
    with suppress(OSError):
        os.nice(NICE)
    _allow_many_files()
    line = sys.stdin.buffer.readline()
    if not line:
        sys.exit(0)  # the process that started this one has ended
    try:
        asyncio.run(_serve(json.loads(line)))
    except DigiclayError as error:
        _tell({"error": str(error)})


def _allow_many_files() -> None:
    """Raise the limit of open files as far as the system lets it: each connection is one."""
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(max(soft, 4096), hard), hard))


def _tell(value: Record) -> None:
    """Write a line of JSON for the process that started this one."""
    with suppress(BrokenPipeError):
        print(json.dumps(value), flush=True)


class _ErrorCount(logging.Handler):
    """Counts errors of the libraries; nothing is printed, since clients could print without end."""

    def __init__(self, link: DoorLink) -> None:
        super().__init__(logging.ERROR)
        self._link = link

    def emit(self, record: logging.LogRecord) -> None:
        """Count an error."""
        self._link.counts[f"errors of {record.name}"] += 1


async def _serve(settings: Record) -> None:
    """Open the doors and serve; tell the addresses, and the counts in the end."""
    orders, frames = (open_slot(Path(name)) for name in settings["slots"])
    link = DoorLink(Bed(**settings["bed"]), orders, frames, settings["token"])
    logging.getLogger().addHandler(_ErrorCount(link))
    host = settings["host"]
    ended = asyncio.Event()
    asyncio.get_running_loop().add_reader(0, _take_wake, link, ended)
    async with AsyncExitStack() as doors:
        ports = {}
        for key, door in DOORS.items():
            try:
                ports[key] = await doors.enter_async_context(door(link, host, settings[key]))
            except (OSError, OverflowError) as error:
                reason = getattr(error, "strerror", None) or error
                raise OutputError(
                    f"Port {settings[key]} of {host} cannot be opened: {reason}."
                ) from None
        _tell(ports)
        os.set_blocking(1, False)
        orders.bell = 1
        await ended.wait()
        orders.bell = None
        os.set_blocking(1, True)
        _tell({"counts": dict(link.counts)})  # before clients that take their time to close
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(doors.aclose(), 3.0)


def _take_wake(link: DoorLink, ended: asyncio.Event) -> None:
    """Take the newest frame, or end."""
    if os.read(0, 65536):
        link.take_frame()
    else:
        asyncio.get_running_loop().remove_reader(0)
        ended.set()


if __name__ == "__main__":
    main()
