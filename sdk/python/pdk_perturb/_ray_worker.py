"""What runs on the machines of a cluster: an actor of Ray that holds a `pdk worker`."""

import json
import os
import subprocess
import tempfile
from pathlib import Path

from pdk_perturb import _files
from pdk_perturb._program import environment


class Ended(Exception):
    """The `pdk worker` of an actor is gone."""


class Worker:
    """A worker of pdk, with what it needs of the session's machine: `files` are as `Sender.take` tells them, `blobs` their bytes."""

    def __init__(self, hello, components, shared):
        self._hello = hello
        self._components = components
        self._shared = shared
        self._traces = None if shared else tempfile.TemporaryDirectory(prefix="pdk-traces-")
        self._child = None

    def start(self, blobs):
        """Starts the worker; returns what it says of itself."""
        import pdk_perturb as pdk

        hello = json.loads(self._hello)
        if not self._shared:
            search = {"plugins": [], "drop_ins": [], "beside": []}
            for is_drop_in, told in self._components:
                path = self._place(told, blobs)
                if is_drop_in:
                    search["drop_ins"].append(os.path.dirname(path))
                else:
                    search["plugins"].append(path)
            hello["hello"]["search"] = search
        self._blobs = blobs
        # Its own errors are those of this process, which Ray shows to the user who runs the pool.
        self._child = subprocess.Popen([str(pdk.executable()), "worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment())
        self._say(hello)
        return self._hear()

    def _place(self, told, blobs):
        import ray

        return _files.place(told, lambda name: ray.get(blobs[name]))

    def _say(self, message):
        try:
            self._child.stdin.write(json.dumps(message).encode() + b"\n")
            self._child.stdin.flush()
        except BrokenPipeError:
            pass  # Its end is noticed where it is to answer.

    def _hear(self):
        line = self._child.stdout.readline()
        if not line.endswith(b"\n"):
            raise Ended(f"`pdk worker` ended with exit code {self._child.wait()}")
        return line.decode()

    def work(self, job, files, blobs):
        """Does a job: returns the lines that the worker says, up to `done` or `failed`, and the bytes of the trace, if it was to
        write one."""
        job, trace = json.loads(job), None
        drive = job["job"]["work"].get("drive")
        contents = drive["scenario"].get("files", {}) if drive else {}
        for steps, told in files:
            placed = self._place(told, blobs)
            named = _put(job, steps, placed)
            if named in contents:
                contents[placed] = contents.pop(named)
        if drive and drive.get("trace") and not self._shared:
            trace = Path(self._traces.name) / os.path.basename(drive["trace"])
            drive["trace"] = str(trace)
        self._say(job)
        said, frames = [], 0
        while True:
            line = self._hear()
            ((kind, value),) = json.loads(line).items()
            # Reporting progress would cost a message each time, so it is reported once, at the end.
            if kind == "progress":
                frames += value["frames"]
                continue
            if kind == "failed":
                return [*said, line], None
            if kind != "done":
                said.append(line)
                continue
            if frames:
                said.append(json.dumps({"progress": {"number": value["number"], "frames": frames}}))
            content = None
            if trace is not None and trace.is_file():
                content = trace.read_bytes()
                trace.unlink()
            return [*said, line], content


def _put(value, steps, replaced):
    """Replaces a value within a value, and returns it."""
    for step in steps[:-1]:
        value = value[step]
    former, value[steps[-1]] = value[steps[-1]], replaced
    return former
