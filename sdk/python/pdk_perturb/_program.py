"""`pdk session` as a process: lines of JSON there and back. See docs/session-protocol.md."""

import json
import os
import queue
import signal
import subprocess
import sys
import threading
from pathlib import Path

from pdk_perturb._pdk import Error
from pdk_perturb._settings import RunSettings

#: Lines of standard error that come as exceptions instead.
_ERROR = "pdk: error: "


def error(kind, message):
    """The exception of this package, with its kind."""
    raised = Error(message)
    raised.kind = kind
    return raised


def written(value, what):
    """A value as JSON. Numbers and arrays of numpy are numbers and lists, paths are texts."""

    def other(value):
        if isinstance(value, os.PathLike):
            return os.fspath(value)
        if hasattr(value, "tolist"):
            return value.tolist()
        raise TypeError(f"a {type(value).__name__}, which is of no use here")

    try:
        return json.dumps(value, default=other, allow_nan=False)
    except (TypeError, ValueError) as wrong:
        raise error("configuration", f"{what} cannot be handed to pdk: {wrong}") from None


def arguments(*, settings, plugins, drop_ins, **run):
    """What is set for a run, as arguments of the command. `run` has the settings of every run."""
    words = []
    for name, value in (settings or {}).items():
        text = value if isinstance(value, str) else written(value, f"the setting {name}")
        words += ["--set", f"{name}={text}"]
    for name, value in run.items():
        if name not in RunSettings.__annotations__:
            raise TypeError(f"a run has no setting {name!r}; it has {', '.join(RunSettings.__annotations__)}")
        flag = f"--{name.replace('_', '-')}"
        if value is True:
            words.append(flag)
        elif value is not None and value is not False:
            words.append(f"{flag}={os.fspath(value) if isinstance(value, os.PathLike) else value}")
    for name, folders in (("plugins", plugins), ("drop-ins", drop_ins)):
        for folder in [folders] if isinstance(folders, (str, os.PathLike)) else folders:
            words += [f"--{name}", os.fspath(folder)]
    return words


def environment():
    """The environment of pdk: programs in Python that it starts are run by this interpreter, and find what this one finds."""
    own = dict(os.environ)
    own["PDK_PYTHON"] = sys.executable
    own["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), own.get("PATH", os.defpath)])
    return own


class _Line:
    """How far a run is, on one line of standard error that is written again and again."""

    def __init__(self):
        self._written = False

    def __call__(self, frames, of):
        sys.stderr.write(f"\r{frames}/{of} frames")
        sys.stderr.flush()
        self._written = True

    def end(self):
        if self._written:
            sys.stderr.write("\n")


class Program:
    """A process `pdk session`, which takes calls and returns answers."""

    def __init__(self, words, progress):
        from pdk_perturb import executable

        self._progress = _Line() if progress is True else progress or None
        self._messages = queue.SimpleQueue()
        self._interrupted = False
        self._error = None
        self._child = subprocess.Popen(
            [str(executable()), "session", *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment(),
            # What is typed at the terminal comes to this process, which tells the other one.
            start_new_session=True,
        )
        self._listening = [
            threading.Thread(target=self._listen, daemon=True),
            threading.Thread(target=self._relay, daemon=True),
        ]
        for thread in self._listening:
            thread.start()

    def _listen(self):
        for line in self._child.stdout:
            self._messages.put(line)
        self._messages.put(None)

    def _relay(self):
        """Shows what is for people, wherever this process shows it."""
        for line in self._child.stderr:
            text = line.decode(errors="replace")
            if text.startswith(_ERROR):
                self._error = text[len(_ERROR) :].strip()
            else:
                sys.stderr.write(text)

    def _interrupt(self):
        self._interrupted = True
        self._child.send_signal(signal.SIGINT)

    def _receive(self):
        """The next message. Ctrl-C lets what is under way finish, and the next one drops it; the message comes in any case."""
        while True:
            try:
                line = self._messages.get()
            except KeyboardInterrupt:
                self._interrupt()
                continue
            if line is None:
                self._child.wait()
                self._listening[1].join(1)
                if self._interrupted:
                    raise KeyboardInterrupt
                ended = f"pdk ended early (exit code {self._child.returncode})"
                raise error("failed", self._error or ended)
            return json.loads(line)

    def receive(self, wanted):
        """The next message of this kind; what comes before it is shown."""
        while True:
            ((kind, value),) = self._receive().items()
            if kind == "progress":
                if self._progress is not None:
                    self._progress(value["frames"], value["of"])
            elif kind == "text":
                print(value)
            elif kind == "failed" and wanted == "returned":
                if self._interrupted:
                    raise KeyboardInterrupt
                raise error(value["kind"], value["message"])
            elif kind == wanted:
                return value

    def call(self, function, argument, what):
        """Calls a function, and returns what it returns."""
        line = written({function: argument}, what)
        try:
            self._child.stdin.write(line.encode() + b"\n")
            self._child.stdin.flush()
        except BrokenPipeError:
            pass  # Its end is noticed below.
        returned = self.receive("returned")
        if self._interrupted:
            raise KeyboardInterrupt
        return returned

    def finish(self, at_end):
        """Waits for the end of the run, after telling that the pipeline is at its end if it is one that calls."""
        try:
            if at_end:
                self._child.stdin.write(b'{"end":{}}\n')
            self._child.stdin.flush()
        except BrokenPipeError:
            pass
        try:
            end = self.receive("end")
        finally:
            if isinstance(self._progress, _Line):
                self._progress.end()
        self.close()
        if self._interrupted:
            raise KeyboardInterrupt
        return end

    def close(self):
        """Ends the process: without its input it gives up what is under way."""
        try:
            self._child.stdin.close()
        except BrokenPipeError:
            pass
        self._child.wait()
        for thread in self._listening:
            thread.join()
        self._child.stdout.close()
        self._child.stderr.close()
