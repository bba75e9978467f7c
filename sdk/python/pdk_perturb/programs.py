"""Drivers and simulators that are classes.

    # pilot.py
    import pdk_perturb as pdk

    class Pilot:
        def __init__(self, gain=1.0):
            self.gain = gain

        def reset(self):                        # a new scenario: forget what was before
            self.last = 0.0

        def drive(self, frame, context):        # see pdk_driver
            return self.gain * (frame[:, 160:].mean() - frame[:, :160].mean()) / 255, 0.3

    pdk.run("manual", {"driver": pdk.driver(Pilot, {"gain": 2})})

Each worker makes an object of its own in a process of its own, so that one that crashes is the error of its scenario. The class has to
be in a file that can be imported, as for multiprocessing: what a file does besides stands behind `if __name__ == "__main__":`.

Needs `pip install 'pdk-perturb[driver]'`.
"""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pdk_perturb._program import error, written

__all__ = ["driver", "simulator"]


def _interpreter():
    """This interpreter as the first word of a command. A plain name, where it means this one to what is started from here: the record
    then holds on other machines too."""
    return "python3" if (Path(sys.executable).parent / "python3").exists() else sys.executable


def _component(kind, cls, arguments, parameters):
    remedy = "write it to a file and import it from there (in a notebook: %%writefile)"
    try:
        file = inspect.getsourcefile(cls)
    except TypeError:
        file = None
    if not inspect.isclass(cls) or file is None or not os.path.isfile(file):
        raise error("configuration", f"{cls!r} is not a class in a file, and other processes have to find it; {remedy}")
    if "<locals>" in cls.__qualname__:
        raise error("configuration", f"{cls.__qualname__} is made inside of a function; {remedy}")
    file = os.path.abspath(file)
    module = Path(file).stem if cls.__module__ == "__main__" else cls.__module__
    given = written(arguments or {}, f"the arguments of {cls.__name__}")
    place = f"{module}:{cls.__qualname__}"
    return {"name": "process", "command": [_interpreter(), "-m", "pdk_perturb.serve", kind, file, place, given], **parameters}


def driver(cls: type, arguments: Mapping[str, Any] | None = None, **parameters: Any) -> dict[str, Any]:
    """A driver that is a class: what a scenario has for `driver`.

    An object is made with `arguments`, a dictionary. It has `drive(frame, context)`, which returns steering and throttle, and, where it
    remembers something, `reset()`. `parameters` are those of the driver `process`: `start_seconds`, `answer_seconds`, `gpus`.
    """
    return _component("driver", cls, arguments, parameters)


def simulator(cls: type, arguments: Mapping[str, Any] | None = None, **parameters: Any) -> dict[str, Any]:
    """A simulator that is a class: what a scenario has for `simulator`.

    An object is made with the camera and `arguments`, a dictionary. It has `reset(scenario, waypoints, slot)`, `act(control)` and
    `frame(into)`; see `pdk_simulator`. `parameters` are those of the simulator `process`: `width`, `height`, `rate`, `start_seconds`,
    `answer_seconds`, `gpus`.
    """
    return _component("simulator", cls, arguments, parameters)
