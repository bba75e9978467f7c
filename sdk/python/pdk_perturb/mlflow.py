"""Records in MLflow: what was run as parameters, what came of it as metrics, and the files as artifacts.

from pdk_perturb import mlflow as pdk_mlflow

record = pdk.run("study", settings={"roads": 8})
pdk_mlflow.log(record, experiment="drivers")

Needs mlflow, with the tracking server that it is set to.
"""

from __future__ import annotations

import json
import tempfile
from os import PathLike
from pathlib import Path
from typing import Any

from pdk_perturb._program import error
from pdk_perturb.records import Record

__all__ = ["log", "metrics", "parameters"]

#: The longest value of a parameter that all tracking servers take.
LONGEST = 500
#: Levels are steps of metrics, which are whole numbers: this many for a level.
STEPS = 100
#: Files of a record that are artifacts if they are there. Traces and clips may be large, and are not.
FILES = (
    "manifest.json",
    "scenarios.jsonl",
    "summary.json",
    "performance.json",
    "verdict.json",
    "blocks.jsonl",
    "report.html",
)


def _mlflow():
    try:
        import mlflow
    except ImportError:
        raise error("configuration", "the logger needs mlflow; install it with `pip install mlflow`") from None
    return mlflow


def parameters(record: Record) -> dict[str, str]:
    """What was run, by name: the version of pdk, the pipeline, the seed, and each setting as `settings.NAME`."""
    manifest = record.manifest
    found = {
        "pdk": manifest["pdk"],
        "pipeline": manifest["pipeline"]["path"],
        "seed": manifest["seed"],
        **{f"settings.{name}": value for name, value in _leaves(manifest.get("settings") or {})},
    }
    texts = {name: value if isinstance(value, str) else json.dumps(value) for name, value in found.items()}
    return {_name(name): text[:LONGEST] for name, text in texts.items()}


def metrics(record: Record) -> list[tuple[str, float, int]]:
    """What came of it: names, values and steps.

    `scenarios`, `failed` and `failure_rate` count all scenarios that say something about a driver. `PERTURBATION/failure_rate` and
    `PERTURBATION/mean_cross_track_error` have a step for each level, 100 times the level. Of an offline evaluation there are
    `PERTURBATION/steering_error` and `PERTURBATION/steering_drift` with the same steps, where what stands for a perturbation has its parameters. A gate has `gate/passed` (0 or 1), and for each
    test `gate/REQUIREMENT/difference`, `low` and `high`. With several drivers, or evaluations, names begin with the driver.
    """
    found: list[tuple[str, float, int]] = []
    if (record.path / "scenarios.jsonl").is_file():
        found += _driven(record)
    if (record.path / "summary.json").is_file():
        found += _evaluated(record)
    if (record.path / "verdict.json").is_file():
        decision = json.loads((record.path / "verdict.json").read_text())["decision"]
        found.append(("gate/passed", float(decision["passed"]), 0))
        for finding in decision["findings"]:
            for name in ("difference", "low", "high") if "test" in finding else ():
                found.append((f"gate/{finding['requirement']}/{name}", finding["test"][name], 0))
    return [(_name(name), value, step) for name, value, step in found]


def log(
    record: Record | str | PathLike[str],
    experiment: str | None = None,
    run_name: str | None = None,
    parquet: bool = False,
) -> str:
    """Logs a record as a run of MLflow, and returns the id of that run.

    `experiment` is the experiment, which is made if it is not there; without it, the one that MLflow is set to. The run is called `run_name`, or as
    the folder of the record. In a run that is active already, that one gets the record. With `parquet`, the tables of `Record.to_parquet` are
    artifacts as well, which needs pyarrow.
    """
    mlflow = _mlflow()
    record = record if isinstance(record, Record) else Record(record)
    if experiment is not None:
        mlflow.set_experiment(experiment)
    active = mlflow.active_run()
    if active is not None:
        _log(mlflow, record, parquet)
        return active.info.run_id
    with mlflow.start_run(run_name=run_name or record.path.resolve().name) as run:
        _log(mlflow, record, parquet)
        return run.info.run_id


def _log(mlflow, record, parquet):
    mlflow.log_params(parameters(record))
    for name, value, step in metrics(record):
        mlflow.log_metric(name, value, step=step)
    mlflow.set_tag("pdk.record", str(record.path.resolve()))
    for name in FILES:
        if (record.path / name).is_file():
            mlflow.log_artifact(str(record.path / name))
    if parquet:
        with tempfile.TemporaryDirectory() as folder:
            for file in record.to_parquet(Path(folder)):
                mlflow.log_artifact(str(file), "parquet")


def _driven(record):
    rows = [row for row in record.rows() if row["verdict"] != "void"]
    drivers = list(dict.fromkeys(row["driver"] for row in rows))
    found = []
    for driver in drivers:
        own = [row for row in rows if row["driver"] == driver]
        prefix = f"{driver}/" if len(drivers) > 1 else ""
        failed = [row["verdict"] != "passed" for row in own]
        found += [
            (f"{prefix}scenarios", float(len(own)), 0),
            (f"{prefix}failed", float(sum(failed)), 0),
            (f"{prefix}failure_rate", sum(failed) / len(own), 0),
        ]
        cells: dict[tuple[str, float], list[Any]] = {}
        for row in own:
            # A perturbation without a level has the step of level 0.
            name = row["perturbation"] or ("several" if row["perturbations"] else "nominal")
            cells.setdefault((name, row["level"] or 0.0), []).append(row)
        for (name, level), some in cells.items():
            step = round(STEPS * level)
            rate = sum(row["verdict"] != "passed" for row in some) / len(some)
            error = sum(row["mean_cross_track_error"] for row in some) / len(some)
            found += [
                (f"{prefix}{name}/failure_rate", rate, step),
                (f"{prefix}{name}/mean_cross_track_error", error, step),
            ]
    return found


def _evaluated(record):
    evaluations = [evaluation for evaluation in record.summary.get("evaluations", []) if "rows" in evaluation]
    told = record.manifest.get("evaluations", [])
    found = []
    for evaluation in evaluations:
        number = evaluation["evaluation"]
        own = told[number] if number < len(told) else {}
        driver = (own.get("driver") or own.get("predictor") or {"name": f"evaluation {number}"})["name"]
        prefix = f"{number + 1}: {driver}/" if len(evaluations) > 1 else ""
        for row in evaluation["rows"]:
            step = round(STEPS * row["level"])
            for name in ("steering_error", "steering_drift"):
                if row.get(name) is not None:
                    found.append((f"{prefix}{row['label']}/{name}", row[name], step))
    return found


def _leaves(value, name=""):
    """The settings without tables in them."""
    if isinstance(value, dict) and value:
        for key, part in value.items():
            yield from _leaves(part, f"{name}.{key}" if name else key)
    elif name:
        yield name, value


def _name(name):
    """A name with the letters that MLflow takes."""
    return "".join(letter if letter.isalnum() or letter in "_-. /:" else "_" for letter in name)[:250]
