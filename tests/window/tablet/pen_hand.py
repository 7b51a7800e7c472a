"""Moves the pen of `screen.py` as a hand does: ``pen_hand.py "to 300 200 0.5 0.8 0" down "sleep 0.1" up``.

A place is in pixels of the screen, with the pressure, 0 to 1, and the tilt to the right and to the
user, each -1 to 1.
"""

import ctypes
import os
import sys
import time

#: Width and height of the screen less one, and the largest value of the axes x, y, pressure and
#: tilt.
SIZE, FULL, TILT = (799, 599), 65535, 63
NAME = b"stylus"


class Device(ctypes.Structure):
    """Xlib's XDeviceInfo."""

    _fields_ = [
        ("id", ctypes.c_ulong),
        ("type", ctypes.c_ulong),
        ("name", ctypes.c_char_p),
        ("num_classes", ctypes.c_int),
        ("use", ctypes.c_int),
        ("classes", ctypes.c_void_p),
    ]


class Pen:
    """The pen of the display in the environment."""

    def __init__(self):
        self.x11, self.xtest = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
        xinput = ctypes.CDLL("libXi.so.6")
        self.x11.XOpenDisplay.restype = ctypes.c_void_p
        self.display = ctypes.c_void_p(self.x11.XOpenDisplay(os.environ["DISPLAY"].encode()))
        xinput.XListInputDevices.restype = ctypes.POINTER(Device)
        xinput.XOpenDevice.restype = ctypes.c_void_p
        count = ctypes.c_int()
        found = xinput.XListInputDevices(self.display, ctypes.byref(count))
        (number,) = (found[index].id for index in range(count.value) if found[index].name == NAME)
        self.device = ctypes.c_void_p(xinput.XOpenDevice(self.display, ctypes.c_ulong(number)))
        self.axes = (ctypes.c_int * 5)()

    def to(self, x, y, pressure, right, near):
        """Move it."""
        place = (x * FULL / SIZE[0], y * FULL / SIZE[1], pressure * FULL, right * TILT, near * TILT)
        self.axes = (ctypes.c_int * 5)(*(round(value) for value in place))
        self.xtest.XTestFakeDeviceMotionEvent(self.display, self.device, 0, 0, self.axes, 5, 0)
        self.x11.XSync(self.display, 0)

    def touch(self, on):
        """Put it on the tablet, or take it off."""
        self.xtest.XTestFakeDeviceButtonEvent(self.display, self.device, 1, on, self.axes, 5, 0)
        self.x11.XSync(self.display, 0)


def main(words):
    """Do what the words say."""
    pen = Pen()
    for word in words:
        name, *numbers = word.split()
        if name == "sleep":
            time.sleep(float(numbers[0]))
        elif name == "to":
            pen.to(*(float(number) for number in numbers))
        else:
            pen.touch(name == "down")


main(sys.argv[1:])
