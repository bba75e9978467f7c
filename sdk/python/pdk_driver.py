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
import time
from dataclasses import dataclass
from pathlib import Path

import iceoryx2
import numpy

# What fails comes as an error. The rest is of no use to whoever reads the output.
iceoryx2.set_log_level(iceoryx2.LogLevel.Fatal)

# How long to wait for a frame before looking whether pdk is still there, in milliseconds.
_LOOK = 100


@dataclass(frozen=True)
class Context:
    """What a driver knows besides the frame."""

    #: Number of the scenario in this process, from 1. With each new one the driver has to forget what it remembers.
    scenario: int
    #: Number of the frame within its scenario, from 0.
    frame_index: int
    #: Simulation time in seconds since the start of the scenario.
    time: float
    #: The vehicle's speed in metres a second; not a number where it is not known.
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
        """Whether pdk is done with it: the owner holds a lock for as long as it lives."""
        try:
            with open(self.folder / "lock", "rb") as lock:
                fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            return False
        except OSError:
            return True


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

    def step(self, wait):
        """Answers a frame where there is one, after waiting for it up to `wait` milliseconds; whether there was one."""
        sample = self._frames.receive()
        if sample is None and wait > 0:
            self._sent.timed_wait(iceoryx2.Duration.from_millis(wait))
            sample = self._frames.receive()
        if sample is None:
            return False
        header = sample.user_header().contents
        stamp = (header.scenario, header.sequence)
        # Until it has been answered once, pdk sends the first frame again and again.
        if self._last is None or self._last[0] != stamp:
            context = Context(header.scenario, header.sequence, header.time, self._speed(stamp))
            # A view of shared memory: nothing is copied.
            frame = numpy.asarray(sample.payload().as_memory_view()).reshape(header.height, header.width, 3)
            frame.flags.writeable = False
            self._last = (stamp, _control(self._drive(frame, context)))
        answer = self._answers.loan_uninit()
        ctypes.memmove(answer.user_header_ptr, ctypes.byref(header), ctypes.sizeof(Header))
        answer.write_payload(self._last[1]).send()
        self._answered.notify()
        return True

    def _speed(self, stamp):
        speed = float("nan")
        while (sample := self._states.receive()) is not None:
            header = sample.user_header().contents
            if (header.scenario, header.sequence) == stamp:
                speed = sample.payload().contents.speed
        return speed


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


def attend(what, link, exchange):
    """Serves the process of pdk that has started this program, or all that ask for an exchange: `link(folder)` meets one."""
    if exchange is None:
        folder = os.environ.get("PDK_EXCHANGE")
        if not folder:
            raise RuntimeError("pdk has not started this program: name the exchange, as in serve(..., exchange='mine')")
        one = link(Path(folder))
        while one.step(_LOOK) or not one.is_over():
            pass
        return
    links = {}
    while True:
        for folder in (_base() / f"{what}-{exchange}").glob("*-*"):
            if folder not in links and (folder / "iceoryx2.toml").exists():
                try:
                    links[folder] = link(folder)
                except Exception:  # It has just ended, or is not complete yet: another look shows.
                    continue
        for folder, one in list(links.items()):
            if not one.step(_LOOK if len(links) == 1 else 1) and one.is_over():
                del links[folder]
        if not links:
            time.sleep(_LOOK / 1000)
