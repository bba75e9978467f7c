"""Records as Parquet, for pandas, DuckDB, Polars and Spark.

record = pdk.Record("runs/study-1")
record.to_parquet("study")
duckdb.sql("select perturbation, avg(cast(success as int)) from 'study/scenarios.parquet' group by all")

Needs pyarrow. Equal records make equal tables. What a scenario does not have is null.
"""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdk_perturb._program import error

if TYPE_CHECKING:
    from pdk_perturb.records import Record

__all__ = ["write"]

#: Lines of offline results that are read at a time.
LINES = 100_000


def _pyarrow():
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise error("configuration", "Parquet needs pyarrow; install it with `pip install pyarrow`") from None
    return pyarrow


def write(record: Record, folder: str | PathLike[str]) -> list[Path]:
    """Writes a record as Parquet to a folder, which is made if it is not there. Returns the files.

    | file | rows |
    |---|---|
    | `scenarios.parquet` | a row for each scenario; the columns are those of `Record.scenarios` |
    | `telemetry.parquet` | a row for each frame that was driven, with the `id` and the `number` of its scenario; a row group for each scenario |
    | `results.parquet` | a row for each frame, perturbation and level of an offline evaluation |

    There is a file for what the record has. One that is there is replaced, once the new one is complete.
    """
    _pyarrow()
    to = Path(folder)
    to.mkdir(parents=True, exist_ok=True)
    files = []
    if (record.path / "scenarios.jsonl").is_file():
        files += [_scenarios(record, to), _telemetry(record, to)]
    if (record.path / "results.jsonl").is_file():
        files.append(_results(record, to))
    if not files:
        raise error("configuration", f"{record.path} holds neither scenarios nor results; wait for the first, or run the pipeline again")
    return files


class _Writer:
    """A file that is there once it is complete."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.part = path.with_name(path.name + ".part")
        self.writer: Any = None

    def add(self, table: Any) -> None:
        if self.writer is None:
            self.writer = _pyarrow().parquet.ParquetWriter(self.part, table.schema)
        self.writer.write_table(table)

    def finish(self) -> Path:
        if self.writer is None:
            self.add(_pyarrow().table({}))
        self.writer.close()
        self.part.replace(self.path)
        return self.path


def _scenarios(record, folder):
    writer = _Writer(folder / "scenarios.parquet")
    rows, kinds = record.rows(), {}
    _add_kinds(kinds, rows)
    writer.add(_table(rows, _schema(kinds)))
    return writer.finish()


def _telemetry(record, folder):
    pyarrow = _pyarrow()
    writer = _Writer(folder / "telemetry.parquet")
    for number, line in enumerate(record.lines()):
        steps = record.steps(number)
        count = len(steps["frame"])
        columns = {
            "id": pyarrow.array([line["id"]] * count, pyarrow.string()),
            "number": pyarrow.array([number] * count, pyarrow.int64()),
            # What was not there is not a number in NumPy, and null here.
            **{name: pyarrow.array(values, from_pandas=True) for name, values in steps.items()},
        }
        writer.add(pyarrow.table(columns))
    return writer.finish()


def _results(record, folder):
    """No line decides alone which columns there are and what they hold: fields of frames that were left out are missing, and a field that
    was a number so far may be a text further on."""
    kinds: dict[str, set[type]] = {}
    left = 0
    for rows in _chunks(record):
        _add_kinds(kinds, rows)
        left += len(rows)
    writer, schema = _Writer(folder / "results.parquet"), _schema(kinds)
    for rows in _chunks(record):
        # Lines that a run has added since then are for the next call.
        if rows := rows[:left]:
            writer.add(_table(rows, schema))
        left -= len(rows)
    return writer.finish()


def _chunks(record):
    rows = []
    with (record.path / "results.jsonl").open() as lines:
        for line in lines:
            if not line.endswith("\n"):
                break
            rows.append(_flat(json.loads(line)))
            if len(rows) == LINES:
                yield rows
                rows = []
    if rows:
        yield rows


def _flat(value, name=""):
    """The fields of a line, with dots in the names of those of objects; lists are JSON."""
    if isinstance(value, dict):
        return {field: found for key, part in value.items() for field, found in _flat(part, f"{name}.{key}" if name else key).items()}
    return {name: json.dumps(value) if isinstance(value, list) else value}


def _add_kinds(kinds, rows):
    """Adds the types of the values in rows, by column."""
    for row in rows:
        for name, value in row.items():
            found = kinds.setdefault(name, set())
            if value is not None:
                found.add(type(value))


def _schema(kinds):
    """The columns of a table. One of whole numbers and others is one of floats, and one of nothing but nulls one of floats too."""
    pyarrow = _pyarrow()

    def kind(found):
        if found == {bool}:
            return pyarrow.bool_()
        if found == {int}:
            return pyarrow.int64()
        return pyarrow.float64() if found <= {float, int} else pyarrow.string()

    return pyarrow.schema([(name, kind(found)) for name, found in kinds.items()])


def _table(rows, schema):
    """Rows as a table. What is not a text is JSON in a column of texts."""
    pyarrow = _pyarrow()
    columns = []
    for field in schema:
        values = [row.get(field.name) for row in rows]
        if field.type == pyarrow.string():
            values = [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]
        columns.append(pyarrow.array(values, field.type))
    return pyarrow.table(columns, schema=schema)
