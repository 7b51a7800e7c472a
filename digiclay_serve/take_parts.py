"""Take of a server in parts: a part is written every few seconds, and all are joined at the end.

Each part is a take by itself, which begins with the state the last one ends with. So a process that is
killed loses the seconds of the part under way, and no written one.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack, suppress
from pathlib import Path

import numpy as np
from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.base.run_folder import Content, claim_folder
from digiclay.core.base.whole_files import write_whole
from digiclay.core.session.take import Take, from_bytes, to_bytes

#: Most parts that wait for the disk.
WAITING = 4
#: Names of takes, and of the parts that a killed process leaves.
TAKE = Content("take", ("take_[0-9][0-9][0-9].npz", f"take_[0-9][0-9][0-9]_part_{5 * '[0-9]'}.npz"))


class PartWriter(AbstractContextManager["PartWriter"]):
    """Thread that writes parts into a folder, which nobody else writes until the block ends.

    Parameters
    ----------
    folder : Path
        None, or an empty one.
    overwrite : bool, optional
        It may hold takes; the first part that is written replaces them.

    Raises
    ------
    OutputError
        On entry, when the folder cannot be used.
    """

    def __init__(self, folder: Path, *, overwrite: bool = False) -> None:
        self.folder, self._overwrite = folder, overwrite
        self.failure = ""
        self._old: list[Path] = []
        self._made = False
        self._until_the_end = ExitStack()
        self._parts: queue.Queue[tuple[Path, Take] | None] = queue.Queue(WAITING)
        self._thread = threading.Thread(target=self._write_all, daemon=True)
        self._session = self._part = 1

    def __enter__(self) -> PartWriter:
        claim = claim_folder(self.folder, overwrite=self._overwrite, content=TAKE)
        self._until_the_end.enter_context(claim)
        try:
            self._old = TAKE.find(self.folder)
            self._made = not self.folder.exists()
            self.folder.mkdir(exist_ok=True, parents=True)
        except OSError as error:
            self._until_the_end.close()
            raise OutputError(f"{self.folder} cannot be made: {error.strerror or error}.") from None
        self._thread.start()
        return self

    def put(self, take: Take, *, last: bool = False) -> None:
        """Hand over a part without waiting for the disk; after a failure nothing is written any more.

        `last`: whether the next part begins elsewhere, as after a reset.
        """
        if self.failure:
            return
        try:
            self._parts.put_nowait((self.folder / f"take_{self._session:03}_part_{self._part:05}.npz", take))
        except queue.Full:
            self.failure = f"The disk is too slow for the take: {self.folder} has what was written until now."
        self._part += 1
        if last:
            self.end_session()

    def end_session(self) -> None:
        """Have the next part begin a take of its own."""
        if self._part > 1:
            self._session, self._part = self._session + 1, 1

    def finish(self) -> list[Path]:
        """Wait for the disk, and join the parts of each take; return the takes."""
        if self._thread.is_alive():
            self._parts.put(None)
            self._thread.join()
        found = sorted(set(self.folder.glob("take_*_part_*.npz")).difference(self._old))
        sessions = sorted({path.name.partition("_part_")[0] for path in found})
        written = []
        for name in sessions:
            parts = [path for path in found if path.name.startswith(f"{name}_part_")]
            target = self.folder / f"{name}.npz"
            write_whole(target, to_bytes(join_parts([from_bytes(path.read_bytes()) for path in parts])))
            for path in parts:
                path.unlink()
            written.append(target)
        return written

    def __exit__(self, *raised: object) -> None:
        if self._thread.is_alive():
            self._parts.put(None)
            self._thread.join()
        if self._made:
            with suppress(OSError):  # it holds a take
                self.folder.rmdir()
        self._until_the_end.close()

    def _write_all(self) -> None:
        """Write what is handed over."""
        while (part := self._parts.get()) is not None:
            if self.failure:
                continue
            try:
                while self._old:
                    self._old.pop().unlink()
                write_whole(part[0], to_bytes(part[1]))
            except (DigiclayError, OSError) as error:
                self.failure = f"The take ends here: {error}"


def join_parts(parts: Sequence[Take]) -> Take:
    """Return one take of parts that follow each other.

    `parts`: oldest first, at least one. Raises OutputError when one does not begin with the state the last
    one ends with.
    """
    first, *others = parts
    end, poses = first.end, [first.poses]
    for part in others:
        if part.start != end or part.scene != first.scene:
            raise OutputError("The parts of a take must follow each other: one of them is missing.")
        end = part.end
        poses.append(part.poses[1:])
    return Take(first.scene, first.start, np.concatenate(poses), end)
