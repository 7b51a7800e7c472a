"""X server with a pen, for a Blender that reads pressure and tilt from it."""

import os
import shutil
import subprocess
from contextlib import contextmanager
from pathlib import Path

HERE = Path(__file__).parent
#: The X server itself: Debian's /usr/bin/Xorg asks who starts it.
SERVERS = ("/usr/lib/xorg/Xorg", "/usr/libexec/Xorg")
MODULES = "/usr/lib/xorg/modules"
#: Where the header of input drivers is, for Debian's xserver-xorg-dev.
HEADERS = "xorg-server"


def find_server():
    """Return the X server's program."""
    return next((name for name in SERVERS if Path(name).is_file()), None)


def find_missing():
    """Return what is missing here for a screen with a pen, or an empty text."""
    missing = [name for name in ("gcc", "pkg-config") if shutil.which(name) is None]
    if find_server() is None or not (Path(MODULES) / "drivers" / "dummy_drv.so").is_file():
        missing.append("Xorg with its driver dummy")
    if (
        "pkg-config" not in missing
        and subprocess.run(["pkg-config", "--exists", HEADERS]).returncode
    ):
        missing.append("the headers of xorg-server")
    return ", ".join(missing)


@contextmanager
def pen_screen(folder):
    """Start an X server whose only pointer is a pen; yield its display."""
    missing = find_missing()
    assert not missing, f"a screen with a pen needs {missing}"
    inputs = folder / "modules" / "input"
    inputs.mkdir(parents=True)
    flags = subprocess.run(
        ["pkg-config", "--cflags", HEADERS], check=True, capture_output=True, encoding="utf-8"
    ).stdout.split()
    command = [
        "gcc",
        "-shared",
        "-fPIC",
        "-o",
        str(inputs / "testpen_drv.so"),
        str(HERE / "testpen_drv.c"),
    ]
    subprocess.run([*command, *flags], check=True, timeout=60)
    told, tell = os.pipe()
    server = find_server()
    options = {
        "-displayfd": str(tell),
        "-nolisten": "tcp",
        "-config": str(HERE / "xorg.conf"),
        "-logfile": str(folder / "xorg.log"),
        "-modulepath": f"{folder / 'modules'},{MODULES}",
    }
    words = [word for option in options.items() for word in option]
    process = subprocess.Popen(
        [server, *words, "-noreset", "-ac", "-sharevts", "-novtswitch"],
        pass_fds=[tell],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(tell)
    try:
        with os.fdopen(told) as line:
            number = line.readline().strip()
        assert number, (folder / "xorg.log").read_text()[-3000:]
        yield f":{number}"
    finally:
        process.terminate()
        process.wait(30)
