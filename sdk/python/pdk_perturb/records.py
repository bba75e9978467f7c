"""Records of runs: scenarios, telemetry and traces as frames of pandas and arrays of numpy.

record = pdk.Record("runs/study-1")
record.scenarios()                    # a row for each scenario
record.telemetry(0)                   # a row for each frame of the first one
numbers, frames = record.frames(0)    # what the driver saw, as far as it was recorded
"""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdk_perturb import _pdk
from pdk_perturb._program import error

if TYPE_CHECKING:
    import numpy
    import pandas
    from numpy.typing import NDArray

__all__ = ["Record"]


def _pandas(what):
    try:
        import pandas
    except ImportError:
        raise error("configuration", f"{what} needs pandas; install it with `pip install pandas`") from None
    return pandas


class Record:
    """The record of a run: the folder that `pdk run` prints."""

    def __init__(self, path: str | PathLike[str]) -> None:
        #: The folder.
        self.path = Path(path)
        if not (self.path / "manifest.json").is_file():
            raise error("configuration", f"{self.path} holds no record; name the folder that `pdk run` printed")
        # The ids, names and digests of scenarios, and when the ledger was as long as it was then.
        self._known: tuple[tuple[int, int] | None, list[tuple[str, str, str]]] | None = None

    def __repr__(self):
        return f"Record({str(self.path)!r})"

    def __fspath__(self) -> str:
        return str(self.path)

    def _json(self, name):
        return json.loads((self.path / name).read_text())

    @property
    def manifest(self) -> dict[str, Any]:
        """What was run: pipeline, settings, seed, versions and hashes."""
        return self._json("manifest.json")

    @property
    def summary(self) -> dict[str, Any]:
        """The outcomes as the pipeline got them, and its evaluations."""
        return self._json("summary.json")

    @property
    def performance(self) -> dict[str, Any]:
        """When and how fast it ran."""
        return self._json("performance.json")

    def lines(self) -> list[dict[str, Any]]:
        """The lines of the ledger, a dictionary each: scenario and outcome. Checksums and ids are checked."""
        return [json.loads(line) for line in _pdk.ledger(self.path)]

    def rows(self) -> list[dict[str, Any]]:
        """A dictionary for each scenario, in the order of submission: what it is, and what came of it.

        Of what a scenario is there are `id`, `name`, `simulator`, `driver`, `road`, its plain fields such as `duration`, `mode`, `seed` and
        `repeat`, and, if it has one perturbation, `perturbation` and `level`; `perturbations` has all of them as texts. The rest is
        the outcome.
        """
        rows = []
        for line in self.lines():
            scenario = line.pop("scenario")
            applied = scenario.get("perturbations", [])
            one = applied[0] if len(applied) == 1 else {}
            level = one.get("level")
            measures = line.pop("measures", None) or {}
            plain = {
                field: value
                for field, value in scenario.items()
                if field != "road" and not isinstance(value, (dict, list))
            }
            rows.append(
                {
                    "id": line.pop("id"),
                    "name": line.pop("name"),
                    "simulator": scenario["simulator"]["name"],
                    "driver": scenario["driver"]["name"],
                    "road": None if scenario.get("road") is None else json.dumps(scenario["road"], sort_keys=True),
                    "perturbation": one.get("name"),
                    "level": level if isinstance(level, (int, float)) else None,
                    "perturbations": [_text(perturbation) for perturbation in applied],
                    "duration": None,
                    "mode": "lockstep",
                    "seed": None,
                    "repeat": 0,
                    **plain,
                    "images_every": line.pop("images_every"),
                    "verdict": _pdk.verdict(line["cause"]),
                    **line,
                    **measures,
                }
            )
        return rows

    def scenarios(self) -> pandas.DataFrame:
        """What `rows` has, as a frame. Needs pandas."""
        return _pandas("a record as a frame").DataFrame(self.rows())

    def to_parquet(self, folder: str | PathLike[str]) -> list[Path]:
        """Writes scenarios, telemetry and offline results as Parquet to a folder, and returns the files: see `pdk_perturb.parquet`. Needs pyarrow."""
        from pdk_perturb import parquet

        return parquet.write(self, folder)

    def results(self) -> pandas.DataFrame:
        """A row for each frame, perturbation and level of an offline evaluation. Needs pandas."""
        pandas = _pandas("a record as a frame")
        path = self.path / "results.jsonl"
        if not path.is_file():
            raise error("configuration", f"there is no {path}: the run evaluated no dataset; see scenarios()")
        with path.open() as lines:
            return pandas.DataFrame([json.loads(line) for line in lines])

    def trace(self, scenario: int | str) -> Path:
        """The file with the trace of a scenario, an MCAP: by its number in the record, its id, or its name if that is unique."""
        return self._trace(scenario)[0]

    def _trace(self, scenario):
        """The file with the trace of a scenario, and the id and the digest that it has to have."""
        scenarios = self._scenarios()
        if isinstance(scenario, str):
            known = [found for found in scenarios if scenario in found[:2]]
        else:
            known = [scenarios[scenario]] if -len(scenarios) <= scenario < len(scenarios) else []
        if len(known) != 1:
            several = "several scenarios" if known else "no scenario"
            raise error("configuration", f"{self.path} has {several} {scenario!r}; name one by its number or its id")
        ((id, _, digest),) = known
        return self.path / "traces" / f"{id}.mcap", id, digest

    def _scenarios(self):
        """The id, the name and the digest of each scenario. The ledger is read again if it has changed."""
        try:
            status = (self.path / "scenarios.jsonl").stat()
            state = (status.st_mtime_ns, status.st_size)
        except OSError:
            # `lines` says what is the matter.
            state = None
        if self._known is None or self._known[0] != state:
            self._known = (state, [(line["id"], line["name"], line["digest"]) for line in self.lines()])
        return self._known[1]

    def telemetry(self, scenario: int | str) -> pandas.DataFrame:
        """A row for each frame of a scenario: state, control, and a hash of what the driver saw. Needs pandas."""
        pandas = _pandas("telemetry as a frame")
        return pandas.DataFrame(self.steps(scenario))

    def steps(self, scenario: int | str) -> dict[str, NDArray[Any]]:
        """As `telemetry`, as a dictionary of arrays."""
        return _pdk.trace_steps(*self._trace(scenario))

    def events(self, scenario: int | str) -> list[tuple[float, str]]:
        """What happened in a scenario: pairs of a time in seconds and a text."""
        return _pdk.trace_events(*self._trace(scenario))

    def frames(self, scenario: int | str, topic: str = "perturbed") -> tuple[NDArray[numpy.uint64], NDArray[numpy.uint8]]:
        """The recorded frames of a scenario: their numbers, and an array of frames x height x width x 3, dtype uint8.

        `topic` is raw, as the camera saw it, or perturbed, as the driver saw it. Traces hold JPEG, and only some frames; see
        `images_every`.
        """
        return _pdk.trace_frames(*self._trace(scenario), topic)


def _text(perturbation):
    """A perturbation as it is named in tables."""
    level = perturbation["level"]
    return f"{perturbation['name']}@{level:g}" if isinstance(level, (int, float)) else f"{perturbation['name']} over time"
