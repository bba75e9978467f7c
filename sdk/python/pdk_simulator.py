"""Simulates for pdk from Python: an object that gets controls and gives states and pictures.

    import pdk_simulator

    class Track:
        def __init__(self, camera):                      # width, height, rate
            self.camera = camera

        def reset(self, scenario, waypoints, slot):      # puts the vehicle at the start of the road
            self.z, self.speed = 0.0, 8.0
            return pdk_simulator.State(position=(0, 0, self.z), speed=self.speed)

        def act(self, control):                          # moves it on by one frame
            self.z += self.speed / self.camera.rate
            return pdk_simulator.State(position=(0, 0, self.z), speed=self.speed)

        def frame(self, into):                           # writes what the camera sees now
            into[:] = 90

    pdk_simulator.serve(Track)

pdk starts such a program with `simulator = { name = "process", command = { "python3", "track.py" }, width = 160, height = 120 }`. One
that runs already is found by the name of its exchange: `pdk_simulator.serve(Track, exchange="track")`.

Needs `pip install iceoryx2 numpy`, with the version 0.10 of iceoryx2, and the file pdk_driver.py beside it.
"""

import ctypes
import json
import math
import traceback
from dataclasses import asdict, dataclass

import iceoryx2
import numpy

from pdk_driver import HEADER_BYTES, Pixels, Room, attend

# Bytes of a reply for which memory is taken at the beginning.
_REPLY = 1 << 14


@dataclass(frozen=True)
class Camera:
    """Size and rate of the camera, from the parameters of the simulator."""

    #: Pixels in a row.
    width: int
    #: Rows.
    height: int
    #: Frames per second of simulation time.
    rate: float


@dataclass(frozen=True)
class Control:
    """What the driver decides."""

    #: From -1 (full left) to 1 (full right).
    steering: float
    #: From -1 (full brake) to 1 (full throttle).
    throttle: float


@dataclass
class State:
    """The state of the vehicle. What is left out follows from the road of the scenario, or is as if there were nothing to tell."""

    #: Position of the vehicle's centre in metres: x, height, z; on the road of the scenario.
    position: tuple
    #: Speed in metres per second.
    speed: float
    #: Heading in radians, clockwise seen from above, 0 towards +z.
    heading: float | None = None
    #: Signed distance from the lane's centre line in metres, positive to the right.
    cross_track_error: float | None = None
    #: The share of the road that has been driven, 0 to 1.
    progress: float | None = None
    #: Simulation time in seconds; if it is left out, a frame further with each control.
    time: float | None = None
    #: Free distance to the vehicle ahead in metres; none on a free road.
    vehicle_ahead: float | None = None
    #: The vehicle has left its lane. If it is left out, it has if its cross-track error is 2 m or more.
    lane_departure: bool | None = None
    #: The vehicle has hit something.
    collision: bool | None = None
    #: The vehicle has reached the end of the road.
    finished: bool | None = None


def _told(state):
    """A state as pdk reads it."""
    state = asdict(state) if isinstance(state, State) else dict(state)
    ahead = state.get("vehicle_ahead")
    if ahead is not None and math.isinf(ahead) and ahead > 0:
        state["vehicle_ahead"] = None
    return {name: _plain(value) for name, value in state.items() if value is not None}


def _plain(value):
    """Numbers and arrays of numpy as those of Python."""
    if hasattr(value, "tolist"):
        return value.tolist()
    return [_plain(each) for each in value] if isinstance(value, (list, tuple)) else value


class _Link(Room):
    """The requests of one process of pdk, and a simulator for it."""

    def __init__(self, folder, make):
        super().__init__(folder)
        self._make = make
        self._simulator = None
        self._requests = self.topic("pdk/request", Pixels).subscriber_builder().create()
        replies = self.topic("pdk/reply", Pixels).publisher_builder().initial_max_slice_len(_REPLY)
        self._replies = replies.allocation_strategy(iceoryx2.AllocationStrategy.PowerOfTwo).create()
        self._pictures = self.topic("pdk/frame", Pixels)
        self._frames = None
        self._asked = self.event("pdk/request-event").listener_builder().create()
        self._replied = self.event("pdk/reply-event").notifier_builder().create()
        self._last = (0, None)

    def step(self, wait):
        """Answers a request if there is one, after waiting for it so long; whether there was one."""
        sample = self._requests.receive()
        if sample is None:
            self._asked.timed_wait(wait)
            sample = self._requests.receive()
        if sample is None:
            return False
        header = sample.user_header().contents
        # Until it has been answered once, pdk sends the first request again and again.
        if header.sequence != self._last[0]:
            self._last = (header.sequence, self._answer(bytes(sample.payload().as_memory_view()), header))
        if self._last[1] is not None:
            self._send(self._replies, self._last[1], header)
        self._replied.notify()
        return True

    def _answer(self, request, header):
        """The reply to a request; none if a picture is."""
        try:
            ((kind, given),) = json.loads(request).items()
            if kind == "hello":
                self._begin(Camera(**given["camera"]))
                reply = {}
            elif kind == "reset":
                reply = {"state": _told(self._simulator.reset(given["scenario"], given["waypoints"], given["slot"]))}
                if hasattr(self._simulator, "waypoints"):
                    reply["waypoints"] = [_plain(point) for point in _plain(self._simulator.waypoints())]
            elif kind == "act":
                reply = {"state": _told(self._simulator.act(Control(**given)))}
            elif kind == "frame":
                self._draw(header)
                return None
            else:
                raise ValueError(f"this pdk_simulator does not know the request `{kind}`; use that of the same pdk")
            return json.dumps(reply, allow_nan=False).encode()
        except Exception as error:
            traceback.print_exc()
            return json.dumps({"error": f"{type(error).__name__}: {error}"[:2000]}).encode()

    def _begin(self, camera):
        size = camera.width * camera.height * 3
        self._frames = self._pictures.publisher_builder().initial_max_slice_len(size).create()
        self._camera = camera
        self._simulator = self._make(camera)

    def _draw(self, header):
        """Has the picture written into memory that pdk reads."""
        camera = self._camera
        sample = self._frames.loan_slice_uninit(camera.width * camera.height * 3)
        picture = numpy.asarray(sample.payload().as_memory_view()).reshape(camera.height, camera.width, 3)
        self._simulator.frame(picture)
        ctypes.memmove(sample.user_header_ptr, ctypes.byref(header), HEADER_BYTES)
        sample.assume_init().send()

    def _send(self, publisher, text, header):
        sample = publisher.loan_slice_uninit(len(text))
        ctypes.memmove(sample.user_header_ptr, ctypes.byref(header), HEADER_BYTES)
        ctypes.memmove(sample.payload_ptr, text, len(text))
        sample.assume_init().send()


def serve(make, exchange=None):
    """Answers requests with the simulator that `make(camera)` makes, a class as a rule; one for each process of pdk.

    It has `reset(scenario, waypoints, slot)` and `act(control)`, which return a `State` or a dictionary of its fields, and
    `frame(into)`, which writes the picture of the present state into an array of height x width x 3 bytes, RGB. `waypoints` is the
    road of the scenario as points (x, height, z) in metres, none if the scenario leaves it to the simulator. A simulator with a
    road of its own tells it with `waypoints()`, which is asked after each `reset`. An exception is the scenario's error.

    In a program that pdk has started, returns when pdk is done. With the name of an exchange it serves every worker that asks for
    it, until it is interrupted.
    """
    attend("simulator", lambda folder: _Link(folder, make), exchange)
