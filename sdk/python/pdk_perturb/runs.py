"""Runs: pipelines, and sessions that drive scenarios one by one.

    record = pdk.run("quickstart", {"levels": [4]})

    with pdk.Session(simulator="lane", driver="lane_keeper", duration=20, seed=1) as session:
        for level in range(5):
            session.submit(perturbations=[{"name": "fog_filter", "level": level}])
        for outcome in session:
            print(outcome["name"], outcome["cause"])

Whatever is driven is driven by processes of their own, which pdk looks after. What goes wrong is a `pdk.Error`, whose `record` is the
folder of what was recorded until then.
"""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from numbers import Integral
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy

from pdk_perturb._program import Program, arguments, error
from pdk_perturb._settings import RunSettings, SessionSettings
from pdk_perturb.records import Record

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["Session", "run"]

#: A simulator or a driver: its name, or a dictionary of its name and parameters.
Component: TypeAlias = "str | Mapping[str, Any]"
#: A scenario: its fields, as in a pipeline.
Scenario: TypeAlias = "Mapping[str, Any]"
#: What happened in a scenario: the fields of an outcome, as in a pipeline.
Outcome: TypeAlias = "dict[str, Any]"
#: Folders or files.
Paths: TypeAlias = "str | PathLike[str] | Sequence[str | PathLike[str]]"
#: Whether progress is shown, or a function that is called with the number of frames that are done and the total.
Progress: TypeAlias = "bool | Callable[[int, int], object]"


def _ended(end: dict[str, Any]) -> Record | None:
    """The record of a run that is over, `None` if it recorded nothing; an exception if it failed."""
    record = None if end["record"] is None else Path(end["record"])
    if end["failure"] is not None:
        raised = error(end["failure"]["kind"], end["failure"]["message"])
        raised.record = record
        raise raised
    return None if record is None else Record(record)


def run(
    pipeline: str | PathLike[str],
    settings: Mapping[str, Any] | None = None,
    *,
    plugins: Paths = (),
    drop_ins: Paths = (),
    progress: Progress = False,
    **run_settings: Unpack[RunSettings],
) -> Record:
    """Runs a pipeline, a file or one that comes with pdk by its name, and returns its `Record`. A pipeline that neither drives nor
    evaluates has none, which is an error.

    `settings` are those of the pipeline, as `--set` sets them; `run_settings` are those that every run has, such as `out`, `seed` and
    `workers`: `pdk.RunSettings` lists them. `plugins` and `drop_ins` are further folders with components.

    Ctrl-C lets what is under way finish, and records it; a second one drops it.
    """
    words = arguments(settings=settings, plugins=plugins, drop_ins=drop_ins, **run_settings)
    program = Program([str(pipeline), *words], progress)
    try:
        record = _ended(program.finish(at_end=False))
    finally:
        program.close()
    if record is None:
        raise error(
            "configuration",
            f"{pipeline} drove no scenario and evaluated no dataset, so there is no record; start it with `pdk run` if that is what it is for",
        )
    return record


def _caller():
    """The file with the program that runs, if there is one."""
    file = getattr(sys.modules.get("__main__"), "__file__", None)
    return [] if file is None or not Path(file).is_file() else ["--program", str(file)]


def _seen(seen):
    """What a metric gets, with outputs as arrays."""
    for name, output in seen["outputs"].items():
        seen["outputs"][name] = numpy.array(output["values"], dtype=numpy.float32).reshape(output["shape"])
    seen.setdefault("recorded", {})
    return seen


class Session:
    """Drives scenarios, which are submitted one by one, and records what comes of them.

    `given` has what scenarios have that do not say it themselves, such as `simulator`, `driver` and `duration`, and what can be set for
    every run: `pdk.SessionSettings` lists both. Scenarios that have not been waited for are driven before the session
    ends, unless its block ends with an exception.
    """

    def __init__(
        self,
        *,
        settings: Mapping[str, Any] | None = None,
        plugins: Paths = (),
        drop_ins: Paths = (),
        progress: Progress = False,
        **given: Unpack[SessionSettings],
    ) -> None:
        own = {name: value for name, value in given.items() if name in RunSettings.__annotations__}
        shared = {name: value for name, value in given.items() if name in SessionSettings.__annotations__ and name not in own}
        if unknown := given.keys() - own.keys() - shared.keys():
            raise TypeError(f"a session has no {', '.join(sorted(unknown))}; it has {', '.join(SessionSettings.__annotations__)}")
        words = arguments(settings=None, plugins=plugins, drop_ins=drop_ins, **own)
        self._defaults = {name: value for name, value in shared.items() if value is not None}
        self._lock = threading.RLock()
        # Tickets whose outcomes have not been taken.
        self._open: set[int] = set()
        self._record: Record | None = None
        self._rates: dict[str, float] = {}
        program = Program([*_caller(), *words], progress)
        self._program: Program | None = program
        try:
            #: How many scenarios are driven at the same time.
            self.slots: int = program.receive("ready")["slots"]
            if settings is not None:
                self._call("settings", settings)
            self._call("defaults", self._defaults)
        except BaseException:
            program.close()
            raise

    def _call(self, function, argument):
        with self._lock:
            if self._program is None:
                raise error("configuration", "the session is over; make another one")
            return self._program.call(function, argument, f"what `{function}` was given")

    def submit(self, scenario: Scenario | None = None, **fields: Any) -> int:
        """Submits a scenario, a dictionary or its fields, and returns a ticket for its outcome without waiting."""
        return self._submit([{**(scenario or {}), **fields}])[0]

    def _submit(self, scenarios):
        with self._lock:
            tickets = self._call("submit", [self._frame_by_frame(scenario) for scenario in scenarios])
            self._open.update(tickets)
            return tickets

    def wait(self, ticket: int) -> Outcome:
        """Waits for the outcome of a ticket."""
        with self._lock:
            try:
                return self._call("wait", ticket)
            finally:
                # A scenario that came to nothing is an error, which is taken too; and an outcome may be asked for again.
                if isinstance(ticket, Integral):
                    self._open.discard(int(ticket))

    def next(self) -> Outcome | None:
        """Waits for the next outcome, as they come, with its ticket; `None` where all have been taken."""
        with self._lock:
            outcome = self._call("next", {})
            # An error does not say whose it is. Its ticket counts until it is waited for, or until nothing is left.
            if outcome is None:
                self._open.clear()
            else:
                self._open.discard(outcome["ticket"])
            return outcome

    def __iter__(self) -> Iterator[Outcome]:
        while (outcome := self.next()) is not None:
            yield outcome

    def drive(self, scenarios: Iterable[Scenario]) -> list[Outcome]:
        """Submits scenarios, waits for all, and returns the outcomes in their order."""
        return [self.wait(ticket) for ticket in self._submit(list(scenarios))]

    @property
    def pending(self) -> int:
        """How many submissions there are whose outcomes have not been taken."""
        return len(self._open)

    def evaluate(
        self,
        *,
        dataset: Component,
        driver: Component | None = None,
        predictor: Component | None = None,
        task: Mapping[str, Any] | None = None,
        metric: Callable[[dict[str, Any]], float | Mapping[str, float]] | None = None,
        perturbations: Sequence[Any] = (),
        levels: Sequence[float] = (),
        frames: int | None = None,
        tolerance: float | None = None,
        trust: bool | None = None,
    ) -> dict[str, Any]:
        """Perturbs the frames of a dataset and compares what the driver makes of them with the recorded truth.

        A driver that is worse than a constant on the frames as they are is an error, unless `trust` is true.

        A `predictor` with a `task` takes the place of the driver, such as `{"kind": "segmentation", "labels": "masks", "classes": [...]}`.
        `metric` is a function of your own in place of the task's: it gets a dictionary with `outputs` (arrays by name; not a number where
        the network gave none), `label` (what `task["labels"]` has for the picture), `recorded` (the recorded steering and throttle, as
        far as there are any), `name`, `width` and `height`, and returns a number, or several by name. Their means are the result.
        """
        if metric is not None:
            task = {**(task or {}), "kind": "function"}
        request: dict[str, Any] = {"dataset": dataset, "driver": driver, "predictor": predictor, "task": task, "frames": frames}
        request |= {"tolerance": tolerance, "trust": trust, "perturbations": list(perturbations) or None, "levels": list(levels) or None}
        request = {name: value for name, value in request.items() if value is not None}
        with self._lock:
            answer = self._call("evaluate", request)
            while metric is not None and "seen" in answer:
                answer = self._call("scored", [metric(_seen(seen)) for seen in answer["seen"]])
            return answer

    def road(self, **request: Any) -> dict[str, Any]:
        """Makes a road, as `pdk.road` does in a pipeline: `road(angles=[0, 10, -10])`, `road(turns=3, seed=1)`."""
        return self._call("road", request)

    def save(self, name: str, value: Any) -> None:
        """Writes a value into the record as a JSON file, whose name ends in `.json`."""
        self._call("save", {"name": name, "value": value})

    def catalog(self, kind: str | None = None) -> list[dict[str, Any]]:
        """What the components say of themselves that the workers of this session have."""
        entries = self._call("catalog", {})
        return [entry for entry in entries if kind in (None, entry["description"]["kind"])]

    def _frame_by_frame(self, scenario):
        """The scenario with the levels of every frame, where a level is a function of time."""

        def is_course(perturbation):
            return isinstance(perturbation, dict) and callable(perturbation.get("level"))

        perturbations = scenario.get("perturbations") or []
        if not any(is_course(perturbation) for perturbation in perturbations):
            return scenario
        whole = {**self._defaults, **scenario}
        simulator = whole.get("simulator")
        key = repr(simulator)
        if key not in self._rates:
            self._rates[key] = self._call("rate", simulator)
        rate = self._rates[key]
        count = math.ceil(whole.get("duration", 30.0) * rate) + 1

        def evaluated(perturbation):
            if not is_course(perturbation):
                return perturbation
            levels = [float(perturbation["level"](frame / rate)) for frame in range(count)]
            return {**perturbation, "level": {"frames": {"rate": rate, "levels": levels}}}

        return {**scenario, "perturbations": [evaluated(perturbation) for perturbation in perturbations]}

    def close(self) -> None:
        """Waits for what was submitted, and completes the record.

        A scenario in which a component failed is an error here only if its outcome was not taken.
        """
        with self._lock:
            program, self._program = self._program, None
            if program is None:
                return
            try:
                self._record = _ended(program.finish(at_end=True))
            except BaseException as raised:
                folder = getattr(raised, "record", None)
                self._record = None if folder is None else Record(folder)
                raise
            finally:
                program.close()

    @property
    def record(self) -> Record:
        """The record, once the session is over."""
        if self._record is None:
            why = (
                "it drove no scenario and evaluated no dataset"
                if self._program is None
                else "it is not over; leave its block first, or call close()"
            )
            raise error("configuration", f"the session has no record: {why}")
        return self._record

    def __enter__(self) -> Session:
        return self

    def __exit__(self, kind: Any, raised: BaseException | None, trace: Any) -> None:
        if kind is None:
            self.close()
        elif isinstance(raised, KeyboardInterrupt):
            # What is under way is finished and recorded.
            try:
                self.close()
            except BaseException:
                pass
        elif self._program is not None:
            program, self._program = self._program, None
            program.close()
