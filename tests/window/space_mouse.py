"""Stand-in for the driver of a 3D mouse: programs connect to it, and what a hand sends comes to them.

The library libspnav, by which Blender reads a 3D mouse on Linux, connects to the socket in
``SPNAV_SOCKET`` and asks first for a version of the protocol. Each motion is then 8 integers: 0,
translation to the right, up and to the user, turns about these axes, and the time since the one
before, ms.
"""

import os
import socket
import struct
import subprocess
import threading
from contextlib import contextmanager

#: Blender asks libspnav only where this file is there, whatever it is.
USUAL = "/var/run/spnav.sock"

VARIABLE = "SPNAV_SOCKET"
#: A motion; the number that a hand sends first, in place of a request of the library.
MOTION, HAND = struct.Struct("8i"), struct.pack("i", 1)


@contextmanager
def driver(folder, blender):
    path, mark = str(folder / "space_mouse"), folder / "made"
    # Where a true driver runs, the file is there already, and stays.
    files = (USUAL, str(mark))
    _run(
        blender, f"import os; os.path.exists({USUAL!r}) or [open(name, 'x') for name in {files!r}]"
    )
    try:
        yield from _listen(path)
    finally:
        if mark.exists():
            _run(blender, f"import os; os.remove({USUAL!r})")


def _run(blender, words):
    options = "--background --factory-startup --python-exit-code 3 --python-expr"
    subprocess.run([blender, *options.split(), words], check=True, timeout=300, capture_output=True)


def _listen(path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(path)
        listener.listen()
        programs = []
        threading.Thread(target=_serve, args=(listener, programs), daemon=True).start()
        try:
            yield path
        finally:
            listener.shutdown(socket.SHUT_RDWR)
            for program in programs:
                program.close()


def _serve(listener, programs):
    """Keep the programs that connect, and pass on what a hand sends, until the listener is shut down."""
    while True:
        try:
            connection, _ = listener.accept()
        except OSError:
            return
        asked = connection.recv(4)
        if asked != HAND:
            connection.sendall(asked)  # the version that it asks for is the one it gets
            programs.append(connection)
            continue
        with connection:
            while sent := connection.recv(MOTION.size, socket.MSG_WAITALL):
                for program in programs:
                    program.sendall(sent)


def push(*motions, pause=16):
    """Push the cap of the 3D mouse: translations and turns, -500 to 500, 0: let go; a pause before, ms."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as hand:
        hand.connect(os.environ[VARIABLE])
        hand.sendall(HAND + b"".join(MOTION.pack(0, *motion, pause) for motion in motions))
