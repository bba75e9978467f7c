"""Records as Parquet and in MLflow: what was written is read by the programs that people read it with."""

import json
from types import SimpleNamespace

import pytest

import pdk_perturb as pdk
from pdk_perturb import mlflow as logger
from pdk_perturb import parquet as writer

PIPELINE = """
local scenarios = {}
for _, angle in { 8, 10 } do
    local road = { angles = { 0, angle, angle, angle, angle }, segment = 15 }
    table.insert(scenarios, { road = road })
    for _, level in { 0.5, 4 } do
        table.insert(scenarios, { road = road, perturbations = { "translate_image@" .. level } })
    end
end
pdk.drive({
    simulator = { name = "lane", width = 80, height = 60, rate = 20 }, driver = "lane_keeper", duration = 20,
    scenarios = scenarios, images_every = IMAGES,
})
"""


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """A driver on two roads, in a clear view and under a perturbation that it does not survive."""
    folder = tmp_path_factory.mktemp("tables")
    pipeline = folder / "pipeline.lua"
    pipeline.write_text(PIPELINE.replace("IMAGES", "1"))
    return pdk.run(pipeline, out=folder / "record")


@pytest.fixture(scope="module")
def offline(record, tmp_path_factory):
    """An evaluation on the frames of the first scenario."""
    folder = tmp_path_factory.mktemp("offline")
    pipeline = folder / "offline.lua"
    pipeline.write_text(
        f"""pdk.evaluate({{
            dataset = {json.dumps(str(record.trace(0)))}, driver = "lane_keeper", perturbations = {{ "contrast" }}, levels = {{ 1, 2.5 }},
            frames = 40, trust = true,
        }})"""
    )
    return pdk.run(pipeline, out=folder / "record")


def test_scenarios_and_telemetry_are_tables(record, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is missing; `pip install pyarrow`")
    files = record.to_parquet(tmp_path / "out")
    assert [file.name for file in files] == ["scenarios.parquet", "telemetry.parquet"]
    scenarios = parquet.read_table(files[0]).to_pylist()
    lines = record.lines()
    assert [row["id"] for row in scenarios] == [line["id"] for line in lines]
    assert [row["success"] for row in scenarios] == [line["success"] for line in lines]
    assert [row["level"] for row in scenarios] == [None, 0.5, 4.0] * 2
    assert isinstance(scenarios[0]["seed"], int) and scenarios[0]["perturbation"] is None
    telemetry = parquet.ParquetFile(files[1])
    assert telemetry.num_row_groups == len(lines)
    assert telemetry.metadata.num_rows == sum(line["frames"] for line in lines)
    columns = telemetry.read_row_group(2).to_pydict()
    assert set(columns["applied_steering"]) == set(columns["observed_speed"]) == {None}
    errors = record.steps(2)["cross_track_error"]
    assert columns["cross_track_error"] == errors.tolist() and set(columns["number"]) == {2}
    # Equal records make equal tables, and nothing is left beside them.
    again = record.to_parquet(tmp_path / "again")
    assert all(parquet.read_table(a).equals(parquet.read_table(b)) for a, b in zip(files, again, strict=True))
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["scenarios.parquet", "telemetry.parquet"]


def test_pandas_and_duckdb_read_them_in_one_line(record, tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow is missing; `pip install pyarrow`")
    pandas = pytest.importorskip("pandas", reason="pandas is missing; `pip install pandas`")
    record.to_parquet(tmp_path)
    frame = pandas.read_parquet(tmp_path / "scenarios.parquet")
    assert frame.groupby("level").success.mean().to_dict() == {0.5: 1.0, 4.0: 0.0}
    duckdb = pytest.importorskip("duckdb", reason="duckdb is missing; `pip install duckdb`")
    query = f"""
        select s.level, max(abs(t.cross_track_error)) from '{tmp_path}/telemetry.parquet' t join '{tmp_path}/scenarios.parquet' s
        using (id) group by s.level order by s.level nulls first
    """
    found = duckdb.sql(query).fetchall()
    assert [level for level, _ in found] == [None, 0.5, 4.0]
    assert found[2][1] == pytest.approx(frame[frame.level == 4].max_cross_track_error.max())


def test_offline_results_are_a_table(offline, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is missing; `pip install pyarrow`")
    (file,) = offline.to_parquet(tmp_path)
    rows = parquet.read_table(file).to_pylist()
    lines = [json.loads(line) for line in (offline.path / "results.jsonl").read_text().splitlines()]
    assert len(rows) == len(lines) == 80
    assert [row["perturbed.steering"] for row in rows] == [line["perturbed"]["steering"] for line in lines]
    assert {row["level"] for row in rows} == {1.0, 2.5}


def test_a_column_may_have_its_first_text_late(tmp_path, monkeypatch):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is missing; `pip install pyarrow`")
    monkeypatch.setattr(writer, "LINES", 2)
    lines = [{"frame": 0, "label": 3}, {"frame": 1}, {"frame": 2, "label": None}, {"frame": 3.5, "label": "car"}, {"frame": 4, "more": [1]}]
    (tmp_path / "results.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in lines) + '{"frame": 5')
    (file,) = writer.write(SimpleNamespace(path=tmp_path), tmp_path / "out")
    columns = parquet.read_table(file).to_pydict()
    assert columns == {
        "frame": [0.0, 1.0, 2.0, 3.5, 4.0],
        "label": ["3", None, None, "car", None],
        "more": [None, None, None, None, "[1]"],
    }


def test_a_record_without_results_is_named(tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow is missing; `pip install pyarrow`")
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(pdk.Error, match="holds neither scenarios nor results"):
        pdk.Record(tmp_path).to_parquet(tmp_path / "out")


def test_parameters_and_metrics_say_what_the_record_says(record, offline):
    found = {(name, step): value for name, value, step in logger.metrics(record)}
    assert found["scenarios", 0] == 6 and found["failed", 0] == 2
    assert found["failure_rate", 0] == pytest.approx(1 / 3)
    assert found["nominal/failure_rate", 0] == 0
    assert found["translate_image/failure_rate", 50] == 0 and found["translate_image/failure_rate", 400] == 1
    parameters = logger.parameters(record)
    assert parameters["pdk"] == record.manifest["pdk"] and parameters["seed"] == "0"
    of_offline = {(name, step): value for name, value, step in logger.metrics(offline)}
    row = offline.summary["evaluations"][0]["rows"][1]
    assert of_offline["contrast/steering_error", 250] == row["steering_error"]


def test_mlflow_has_the_record(record, tmp_path):
    mlflow = pytest.importorskip("mlflow", reason="mlflow is missing; `pip install mlflow`")
    mlflow.set_tracking_uri(f"sqlite:///{tmp_path}/mlflow.db")
    try:
        experiment = mlflow.create_experiment("drivers", artifact_location=(tmp_path / "artifacts").as_uri())
        run = logger.log(record, experiment="drivers", run_name="first")
        client = mlflow.MlflowClient()
        kept = client.get_run(run)
        assert kept.info.experiment_id == experiment and kept.info.run_name == "first"
        assert kept.data.metrics["failed"] == 2 and kept.data.params["pdk"] == record.manifest["pdk"]
        history = client.get_metric_history(run, "translate_image/failure_rate")
        assert [(metric.step, metric.value) for metric in history] == [(50, 0.0), (400, 1.0)]
        names = {artifact.path for artifact in client.list_artifacts(run)}
        assert {"manifest.json", "scenarios.jsonl", "summary.json"} <= names
        # In a run that is active, that one gets it.
        with mlflow.start_run() as active:
            assert logger.log(record) == active.info.run_id
    finally:
        mlflow.set_tracking_uri(None)
