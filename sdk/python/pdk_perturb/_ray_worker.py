"""What runs on the machines of a cluster: actors of Ray that hold a `pdk worker` each, and one on each machine that passes on what the
pool and they say."""

import asyncio
import hashlib
import json
import os
import subprocess
import tempfile
import time
from pathlib import Path

from pdk_perturb import _files
from pdk_perturb._program import environment


#: After this many seconds a relay answers although it has nothing to say.
LONGEST = 10.0
#: After this many bytes of traces, what else is finished waits for the next answer.
MOST = 8 << 20


class Ended(Exception):
    """The `pdk worker` of an actor is gone."""


class Missing(Exception):
    """Jobs that the pool has sent did not arrive."""


class Worker:
    """A worker of pdk, with what it needs of the session's machine: `files` are as `Sender.take` tells them, `blobs` their bytes."""

    def __init__(self, hello, components, shared):
        self._hello = hello
        self._components = components
        self._shared = shared
        self._traces = None if shared else tempfile.TemporaryDirectory(prefix="pdk-traces-")
        self._child = None

    def start(self, blobs):
        """Starts the worker. Returns a hash of what it says of itself, and the id of its machine."""
        import ray

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
        self._said = self._hear()
        return digest(self._said), ray.get_runtime_context().get_node_id()

    def said(self):
        """What the worker said of itself. All of them say the same as a rule, and it is long."""
        return self._said

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

    def work(self, line, slot, files, blobs):
        """Does a job. Returns the lines that the worker says, up to `done` or `failed`, as one text; the bytes of the trace, if it was
        to write one; and whether it says that this machine cannot do the job."""
        job, trace = json.loads(line), None
        job["job"]["slot"] = slot
        drive = job["job"]["work"].get("drive")
        contents = drive["scenario"].get("files", {}) if drive else {}
        moved = {}
        for steps, told in files:
            placed = self._place(told, blobs)
            named = _put(job, steps, placed)
            if named in contents:
                contents[placed], moved[named] = contents.pop(named), placed
            # A file may be named several times.
            elif moved.get(named) != placed:
                # A word of a command: with another path there, the scenario has another id here, for which the worker would refuse it.
                job["job"]["moved"] = True
        if drive and drive.get("trace") and not self._shared:
            trace = Path(self._traces.name) / os.path.basename(drive["trace"])
            drive["trace"] = str(trace)
        self._say(job)
        said, frames = [], 0
        while True:
            line = self._hear().strip()
            ((kind, value),) = json.loads(line).items()
            # Reporting progress would cost a message each time, so it is reported once, at the end.
            if kind == "progress":
                frames += value["frames"]
                continue
            if kind == "failed":
                return "\n".join([*said, line]), None, False
            if kind != "done":
                said.append(line)
                continue
            if frames:
                said.append(json.dumps({"progress": {"number": value["number"], "frames": frames}}))
            content = None
            if trace is not None and trace.is_file():
                content = trace.read_bytes()
                trace.unlink()
            return "\n".join([*said, line]), content, "broken" in value["answer"]


class Relay:
    """Passes on jobs from the pool to the workers of a machine or of several, and back what they say: a message of Ray costs the pool more than all
    that it does for a job, so what is there at the same time goes together. An answer is a slot, how its job ended, and what belongs to that:

    - `done` or `broken`: the lines of the worker, and the bytes of its trace or `None`.
    - `lost`, with the reason: the worker is gone.
    - `failed`, with a sentence: a mistake that would be made again elsewhere.
    """

    def __init__(self):
        self._workers = {}
        self._received = 0
        self._running = set()
        self._finished = []
        self._some = asyncio.Event()
        self._answered = 0.0

    async def ready(self):
        """Returns as soon as this one is there."""

    async def give(self, jobs):
        """Takes jobs, each with its slot and what `Worker.work` takes. The first one for a worker comes with the handle of it."""
        for slot, handle, *job in jobs:
            if handle is not None:
                self._workers[slot] = handle
            # The event loop itself does not keep tasks.
            task = asyncio.ensure_future(self._pass(slot, *job))
            self._running.add(task)
            task.add_done_callback(self._running.discard)
        self._received += len(jobs)

    async def _pass(self, slot, line, files, blobs):
        try:
            answer = await self._work(slot, line, files, blobs)
        except Exception as raised:
            answer = (slot, *ended(raised), None)
        self._finished.append(answer)
        self._some.set()

    async def _work(self, slot, line, files, blobs):
        said, trace, is_broken = await self._workers[slot].work.remote(line, slot, files, blobs)
        return slot, "broken" if is_broken else "done", said, trace

    async def take(self, given, pause):
        """Returns the answers that there are, as soon as there is one, but not sooner than this many seconds after the last time. `given` is
        how many jobs the pool has sent so far."""
        try:
            await asyncio.wait_for(self._some.wait(), LONGEST)
        except asyncio.TimeoutError:
            if self._received < given:
                raise Missing(f"{given - self._received} jobs were sent to a machine and did not arrive") from None
            return []
        await asyncio.sleep(self._answered + pause - time.monotonic())
        self._answered = time.monotonic()
        count = size = 0
        for answer in self._finished:
            count, size = count + 1, size + len(answer[3] or b"")
            if size >= MOST:
                break
        taken, self._finished = self._finished[:count], self._finished[count:]
        if not self._finished:
            self._some.clear()
        return taken


def digest(line):
    """A hash of what a worker says of itself."""
    return hashlib.sha256(line.encode()).hexdigest()


def ended(raised):
    """Whether a worker is lost, or what it holds, with the reason; what else is raised in one is a mistake that would be made again elsewhere."""
    import ray

    errors = ray.exceptions
    if isinstance(raised, errors.RayError):
        if not isinstance(raised, errors.RayTaskError) or isinstance(raised.cause, (Ended, errors.RayError)):
            return "lost", reason(raised)
    return "failed", f"{type(raised).__name__}: {raised}".strip().splitlines()[-1]


def reason(raised):
    """Why an actor is gone: the first sentence of the last line. Before it come tracebacks and lists of ids, and then advice."""
    cause = getattr(raised, "cause", raised)
    lines = str(cause).strip().splitlines() or [type(cause).__name__]
    return lines[-1].strip().partition(". ")[0].rstrip(".")


def _put(value, steps, replaced):
    """Replaces a value within a value, and returns it."""
    for step in steps[:-1]:
        value = value[step]
    former, value[steps[-1]] = value[steps[-1]], replaced
    return former
