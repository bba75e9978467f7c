"""Drives for pdk from Python: a function that gets frames and gives controls.

    import pdk_driver

    def drive(frame, context):
        return 0.0, 0.3  # steering, throttle

    pdk_driver.serve(drive)

pdk starts such a program with `driver = { name = "process", command = { "python3", "pilot.py" } }`. One that runs already is found by
the name of its exchange: `pdk_driver.serve(drive, exchange="pilot")` and `driver = { name = "process", exchange = "pilot" }`.

Needs `pip install iceoryx2 numpy`, with the version 0.10 of iceoryx2.
"""

import ctypes
import fcntl
import os
import sys
import time
from pathlib import Path
from typing import NamedTuple

import iceoryx2
import numpy

# Failures come as errors. The rest is of no use to the reader of the output.
iceoryx2.set_log_level(iceoryx2.LogLevel.Fatal)

# How long to wait before looking whether pdk is still there, in milliseconds; and where several of its processes are met, before looking
# at another one.
_LOOK = 100
_GLANCE = 1
# After this many seconds an exchange that cannot be opened is reported. Until then it may not be complete yet.
_PATIENCE = 1.0


class Context(NamedTuple):
    """What a driver knows besides the frame."""

    #: Number of the scenario in this process, from 1. With each new one the driver has to forget what it remembers.
    scenario: int
    #: Number of the frame within its scenario, from 0.
    frame_index: int
    #: Simulation time in seconds since the start of the scenario.
    time: float
    #: The vehicle's speed in metres a second; not a number if it is not known.
    speed: float


class Header(ctypes.Structure):
    """What every message of pdk begins with."""

    _fields_ = [
        ("run", ctypes.c_uint64),
        ("scenario", ctypes.c_uint64),
        ("sequence", ctypes.c_uint64),
        ("number", ctypes.c_uint64),
        ("time", ctypes.c_double),
        ("sent_at", ctypes.c_uint64),
        ("slot", ctypes.c_uint32),
        ("width", ctypes.c_uint32),
        ("height", ctypes.c_uint32),
        ("format", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "PdkFrameHeader"


#: How many bytes that is.
HEADER_BYTES = ctypes.sizeof(Header)

#: The payload of a picture, and of any text.
Pixels = iceoryx2.Slice[ctypes.c_uint8]


class _Control(ctypes.Structure):
    _fields_ = [("steering", ctypes.c_double), ("throttle", ctypes.c_double)]

    @staticmethod
    def type_name():
        return "PdkControl"


class _State(ctypes.Structure):
    _fields_ = [
        ("time", ctypes.c_double),
        ("position", ctypes.c_double * 3),
        ("heading", ctypes.c_double),
        ("speed", ctypes.c_double),
        ("cross_track_error", ctypes.c_double),
        ("progress", ctypes.c_double),
        ("vehicle_ahead", ctypes.c_double),
        ("flags", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "PdkState"


class Room:
    """Where this program meets one process of pdk: its services, and whether it is still there. `pdk_simulator` uses it as well."""

    def __init__(self, folder):
        self.folder = folder
        config = iceoryx2.config.from_file(iceoryx2.FilePath.new(str(folder / "iceoryx2.toml")))
        builder = iceoryx2.NodeBuilder.new().config(config)
        # Ctrl-C belongs to the program.
        builder = builder.signal_handling_mode(iceoryx2.SignalHandlingMode.Disabled)
        self._node = builder.create(iceoryx2.ServiceType.Ipc)

    def _service(self, name):
        return self._node.service_builder(iceoryx2.ServiceName.new(name))

    def topic(self, name, payload):
        """The ports of a topic."""
        return self._service(name).publish_subscribe(payload).user_header(Header).open()

    def event(self, name):
        """The ports of an event."""
        return self._service(name).event().open()

    def is_over(self):
        """Whether pdk is done with it."""
        return not _has_owner(self.folder)


def _has_owner(folder):
    """Whether a process of pdk is there: it holds a lock for as long as it lives."""
    try:
        with open(folder / "lock", "rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return False
    except BlockingIOError:
        return True
    except OSError:
        return False


class _Link(Room):
    """The exchange with one process of pdk."""

    def __init__(self, folder, drive):
        super().__init__(folder)
        self._drive = drive
        self._frames = self.topic("pdk/perturbed", Pixels).subscriber_builder().create()
        self._states = self.topic("pdk/state", _State).subscriber_builder().create()
        self._answers = self.topic("pdk/answer", _Control).publisher_builder().create()
        self._sent = self.event("pdk/frame-event").listener_builder().create()
        self._answered = self.event("pdk/answer-event").notifier_builder().create()
        self._last = None
        # The frames that there is room for, by their addresses.
        self._views = {}

    def step(self, wait):
        """Answers a frame if there is one, after waiting for it so long; whether there was one."""
        sample = self._frames.receive()
        if sample is None:
            self._sent.timed_wait(wait)
            sample = self._frames.receive()
        if sample is None:
            return False
        header = Header.from_address(sample.user_header_ptr)
        stamp = (header.scenario, header.sequence)
        # Until it has been answered once, pdk sends the first frame again and again.
        if self._last is None or self._last[0] != stamp:
            context = Context(header.scenario, header.sequence, header.time, self._speed(stamp))
            frame = self._view(sample.payload_ptr, header.height, header.width)
            self._last = (stamp, _control(self._drive(frame, context)))
        answer = self._answers.loan_uninit()
        ctypes.memmove(answer.user_header_ptr, sample.user_header_ptr, HEADER_BYTES)
        answer.write_payload(self._last[1]).send()
        self._answered.notify()
        return True

    def _view(self, address, height, width):
        """The frame at an address of the shared memory: nothing is copied."""
        view = self._views.get(address)
        if view is None:
            pixels = (ctypes.c_uint8 * (height * width * 3)).from_address(address)
            view = numpy.frombuffer(pixels, numpy.uint8).reshape(height, width, 3)
            view.flags.writeable = False
            self._views[address] = view
        # Its shape is the function's own.
        return view.view()

    def _speed(self, stamp):
        """The speed in the state that was sent before the frame with this stamp."""
        while (sample := self._states.receive()) is not None:
            header = Header.from_address(sample.user_header_ptr)
            if (header.scenario, header.sequence) == stamp:
                return _State.from_address(sample.payload_ptr).speed
        return float("nan")


def _control(answer):
    """Steering and throttle that a function has returned."""
    try:
        steering, throttle = answer
        if isinstance(steering, str) or isinstance(throttle, str):
            raise TypeError
        return _Control(float(steering), float(throttle))
    except (TypeError, ValueError):
        raise SystemExit(f"the function returned {answer!r}, but has to return two numbers, steering and throttle") from None


def _base():
    """The folder below which the exchanges of this user lie."""
    if named := os.environ.get("PDK_BUS_DIR"):
        return Path(named)
    if runtime := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(runtime) / "pdk"
    return Path(f"/dev/shm/pdk-{os.getuid()}")


def serve(drive, exchange=None):
    """Answers frames with what `drive(frame, context)` returns: steering from -1 (left) to 1 (right), and throttle from -1 (brake) to 1.

    `frame` is an array of height x width x 3 bytes, RGB: a view of shared memory that is valid until the function returns. Copy
    what is to be kept. `context` is a `Context`.

    In a program that pdk has started, returns when pdk is done. With the name of an exchange it serves every worker that asks for
    it, one frame after the other, until it is interrupted.
    """
    attend("driver", lambda folder: _Link(folder, drive), exchange)


def _report(what, folder, error):
    """Says why an exchange cannot be opened."""
    print(
        f"{folder}: this exchange of pdk cannot be opened ({type(error).__name__}: {error}); install the version 0.10 of iceoryx2, and take "
        f"pdk_{what}.py from the pdk that runs",
        file=sys.stderr,
        flush=True,
    )


def attend(what, link, exchange):
    """Serves the process of pdk that has started this program, or all that ask for an exchange: `link(folder)` meets one."""
    look, glance = (iceoryx2.Duration.from_millis(milliseconds) for milliseconds in (_LOOK, _GLANCE))
    if exchange is None:
        folder = os.environ.get("PDK_EXCHANGE")
        if not folder:
            raise RuntimeError("pdk has not started this program: name the exchange, as in serve(..., exchange='mine')")
        one = link(Path(folder))
        while one.step(look) or not one.is_over():
            pass
        return
    links = {}
    # When each exchange that cannot be opened was tried first; none once that was reported.
    failing = {}
    looked = float("-inf")
    while True:
        if time.monotonic() - looked >= _LOOK / 1000:
            for folder in (_base() / f"{what}-{exchange}").glob("*-*"):
                if folder not in links and (folder / "iceoryx2.toml").exists():
                    try:
                        links[folder] = link(folder)
                        failing.pop(folder, None)
                    except Exception as error:  # It has just ended, or is not complete yet: another look shows.
                        now = time.monotonic()
                        first = failing.setdefault(folder, now)
                        if first is not None and now - first >= _PATIENCE and _has_owner(folder):
                            failing[folder] = None
                            _report(what, folder, error)
            looked = time.monotonic()
        for folder, one in list(links.items()):
            if not one.step(look if len(links) == 1 else glance) and one.is_over():
                del links[folder]
        if not links:
            time.sleep(_LOOK / 1000)
