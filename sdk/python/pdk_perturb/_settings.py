"""The keyword arguments of runs. Written by `PDK_BLESS=1 cargo test --release -p pdk-pipeline`."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any, TypedDict


class RunSettings(TypedDict, total=False):
    """What can be set for every run; `None` leaves a setting as it is."""

    #: The seed that all random numbers come from [default: 0].
    seed: int | None

    #: How many scenarios or frames are computed at the same time [default: one for each processor; one for a simulator that pdk does not start].
    workers: int | None

    #: The folder of the record [default: runs/NAME-N].
    out: str | PathLike[str] | None

    #: The engine for networks that do not set one, such as onnxruntime.
    engine: str | None

    #: How many seconds one call of a component may take [default: 60].
    patience: float | None

    #: How much memory a worker may take, in MiB [default: 4096].
    memory: int | None

    #: A command that provides workers, in the place of this machine's (see docs/worker-protocol.md).
    pool: str | None

    #: Which part of the scenarios and frames is computed, such as 1/8; `pdk merge` puts the parts together.
    shard: str | None

    #: Whether a run that is continued keeps the scenarios in which a component failed instead of driving them again.
    keep_errors: bool | None


class SessionSettings(RunSettings, total=False):
    """The settings of a session, which include the defaults of its scenarios."""

    #: The simulator.
    simulator: str | Mapping[str, Any] | None

    #: The driver under test.
    driver: str | Mapping[str, Any] | None

    #: The time limit in seconds of simulation time; 30 if it is left out.
    duration: float | None

    #: What counts as a failure. What it leaves out is the default.
    failure: Mapping[str, Any] | None

    #: Every how many frames an image goes into the trace: 6 if it is left out, 0 for none. Of a scenario that fails, the last frame goes there too, and those one and two seconds before if no image of them is there.
    images_every: int | None

    #: Whether the simulator waits for the driver (`lockstep`), as it does if this is left out and it can, or goes on by the clock (`realtime`).
    mode: str | None


#: What every perturbation takes besides its level and its own parameters, with its type.
MODIFIERS = {
    "probability": 'float',
    "region": 'Mapping[str, Any] | Sequence[float]',
    "during": 'Mapping[str, Any]',
    "where": 'Mapping[str, Any]',
    "attention": 'str | Mapping[str, Any]',
    "level_scale": 'str | Mapping[str, Any]',
    "draws": 'Literal["per_frame", "per_sequence"]',
}
