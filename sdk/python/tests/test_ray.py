"""Workers on a cluster of Ray: three nodes on this machine. Skipped without Ray."""

import hashlib
import json
import os
import threading
from pathlib import Path

import pytest

pytest.importorskip("ray", reason="ray is missing; `pip install 'pdk[ray]'`")
os.environ["RAY_AUTH_MODE"] = "disabled"
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

from ray.cluster_utils import Cluster  # noqa: E402

import pdk  # noqa: E402
from pdk.ray import Paths, gpus, options  # noqa: E402

PIPELINE = """
local settings = pdk.settings({ mode = "lockstep", duration = 2, scenarios = 12 })
local scenarios = {}
for number = 1, settings.scenarios do
    table.insert(scenarios, {
        road = { angles = { 0, number % 9, -(number % 9) }, segment = 20 }, perturbations = { "darker@" .. number % 5 }, ["repeat"] = number,
    })
end
pdk.drive({
    simulator = { name = "lane", width = 160, height = 120 }, driver = "lane_keeper", duration = settings.duration, images_every = 10,
    mode = settings.mode, scenarios = scenarios,
})
"""

DARKER = """
return {
    doc = "Darkens the frame",
    family = "custom",
    mathematics = "share v",
    source = "A pane of tinted glass",
    parameters = { { name = "share", levels = { 0.9, 0.8, 0.7, 0.6, 0.5 }, min = 0, max = 1, doc = "what is left of the light" } },
    apply = function(image, cx)
        image:brightness(cx.share)
    end,
}
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Where what travels is kept: that of the machines, which are started after this."""
    folder = tmp_path_factory.mktemp("cache")
    os.environ["PDK_CACHE"] = str(folder)
    yield folder
    del os.environ["PDK_CACHE"]


@pytest.fixture(scope="module")
def cluster(cache):
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    cluster.add_node(num_cpus=1)
    cluster.add_node(num_cpus=1, num_gpus=1)
    cluster.wait_for_nodes()
    yield cluster
    cluster.shutdown()


@pytest.fixture
def study(tmp_path):
    (tmp_path / "study.lua").write_text(PIPELINE)
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins/darker.lua").write_text(DARKER)

    def run(out, settings=None, **more):
        return pdk.run(tmp_path / "study.lua", settings, out=tmp_path / out, seed=3, plugins=tmp_path / "plugins", **more)

    return run


def ledger(record):
    return sorted((record.path / "scenarios.jsonl").read_text().splitlines())


def test_a_study_on_three_nodes_gives_the_same_ledger(cluster, study, cache):
    here = study("here")
    there = study("there", pool=f"ray --address {cluster.address}")
    assert there.performance["drive"]["workers"] == 3
    assert ledger(there) == ledger(here) and len(ledger(here)) == 12
    for trace in (here.path / "traces").iterdir():
        assert (there.path / "traces" / trace.name).read_bytes() == trace.read_bytes()
    # The script travelled by its content.
    name = hashlib.sha256(DARKER.encode()).hexdigest()[:32]
    assert (cache / "travelled" / name / "darker.lua").read_text() == DARKER
    shared = study("shared", pool=f"ray --shared --slots 2 --address {cluster.address}")
    assert ledger(shared) == ledger(here)


def test_a_network_travels_by_its_content(cluster, tmp_path, cache):
    network = Path(__file__).parents[3] / "scripts/models/dave2.onnx"
    if not network.is_file():
        pytest.skip(f"{network} is not there")
    model = tmp_path / "pilot.onnx"
    model.write_bytes(network.read_bytes())
    shared = {"simulator": "lane", "driver": {"name": "onnx", "model": str(model)}, "duration": 1, "seed": 1}
    digests = []
    for out, pool in (("here", None), ("there", f"ray --slots 1 --address {cluster.address}")):
        with pdk.Session(**shared, out=tmp_path / out, pool=pool) as session:
            digests.append(session.drive([{}])[0]["digest"])
    assert digests[0] == digests[1]
    name = hashlib.sha256(model.read_bytes()).hexdigest()[:32]
    assert (cache / "travelled" / name / "pilot.onnx").is_file()
    # The record names the file where it is on the session's machine.
    assert session.record.lines()[0]["scenario"]["driver"]["parameters"]["model"] == str(model)


def test_a_node_that_is_killed_in_the_middle_costs_nothing_but_time(cluster, study):
    settings = {"scenarios": 30, "duration": 6}
    here = study("here", settings)
    lost = cluster.add_node(num_cpus=2)
    done = []

    def kill(frames, of):
        if frames > of / 4 and not done:
            done.append(frames)
            threading.Thread(target=lambda: cluster.remove_node(lost, allow_graceful=False)).start()

    there = study("there", settings, pool=f"ray --slots 5 --address {cluster.address}", progress=kill)
    assert done and ledger(there) == ledger(here) and len(ledger(here)) == 30


def test_who_needs_a_gpu_is_placed_where_one_is(cluster, tmp_path, monkeypatch):
    pytest.importorskip("iceoryx2")
    (tmp_path / "gpu_pilot.py").write_text(
        "import os\n"
        "class Pilot:\n"
        "    def __init__(self, note): open(note, 'a').write(os.environ.get('CUDA_VISIBLE_DEVICES', 'none') + '\\n')\n"
        "    def drive(self, frame, context): return 0.0, 0.3\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    from gpu_pilot import Pilot

    for share, seen in ((0.5, {"0"}), (0, {"", "none"})):
        note = tmp_path / f"note{share}"
        driver = pdk.driver(Pilot, {"note": str(note)}, gpus=share)
        with pdk.Session(
            simulator={"name": "lane", "width": 64, "height": 48},
            driver=driver,
            duration=0.5,
            out=tmp_path / f"out{share}",
            pool=f"ray --slots 2 --address {cluster.address}",
        ) as session:
            assert [o["cause"] for o in session.drive([{}, {"repeat": 1}])] == ["time_out"] * 2
        assert set(note.read_text().splitlines()) <= seen


def test_a_mistake_is_one_sentence(cluster, study):
    with pytest.raises(pdk.Error, match="ended before it was ready"):
        study("out", pool="ray --slots 0")


def test_paths_in_a_job_are_found_by_descriptions():
    parameter = {"doc": "", "unit": ""}
    catalog = [
        {"description": {"kind": kind, "name": name, "parameters": [{**parameter, "name": n, "type": t} for n, t in given.items()]}}
        for kind, name, given in [
            ("driver", "onnx", {"model": "path", "backend": "text"}),
            ("simulator", "process", {"command": "json", "gpus": "number"}),
            ("perturbation", "repaint", {"model": "path"}),
            ("saliency", "hirescam", {"model": "path"}),
            ("dataset", "tub", {"path": "path"}),
        ]
    ]
    where = {"top": 20, "by": {"name": "hirescam", "parameters": {"model": "s.onnx"}}}
    applied = {"name": "repaint", "level": 1, "parameters": {"model": "r.onnx"}, "region": {"mask": "m.png"}, "where": where}
    simulator = {"name": "process", "parameters": {"command": ["python3", "town.py", "--fast"], "gpus": 0.25}}
    driver = {"name": "onnx", "parameters": {"model": "p.onnx", "backend": "m.png"}}
    scenario = {"simulator": simulator, "driver": driver, "perturbations": [applied]}
    paths = Paths(catalog)

    def found(work):
        job = {"job": {"number": 0, "slot": 0, "work": work}}
        return [json.dumps(steps[3:]) for steps in paths.find(job)], gpus(job)

    steps, needed = found({"drive": {"scenario": scenario, "name": "x", "trace": "/runs/x.mcap"}})
    assert steps == [
        '["scenario", "simulator", "parameters", "command", 1]',
        '["scenario", "simulator", "parameters", "command", 2]',
        '["scenario", "driver", "parameters", "model"]',
        '["scenario", "perturbations", 0, "parameters", "model"]',
        '["scenario", "perturbations", 0, "region", "mask"]',
        '["scenario", "perturbations", 0, "where", "by", "parameters", "model"]',
    ]
    assert needed == 0.25
    assert found({"make": {"kind": "driver", "component": driver}}) == (['["component", "parameters", "model"]'], 0)
    evaluation = {"dataset": {"name": "tub", "parameters": {"path": "data"}}, "driver": driver, "perturbations": [], "seed": 0}
    steps, _ = found({"evaluate": {"evaluation": evaluation, "index": 0}})
    assert len(steps) == 2
    assert options(["--slots", "3", "--resources", '{"simulators": 1}']).resources == {"simulators": 1}


def test_files_travel_once_and_arrive_as_they_were(tmp_path, monkeypatch):
    from pdk import _files

    monkeypatch.setenv("PDK_CACHE", str(tmp_path / "cache"))
    blobs = {}
    sender = _files.Sender(lambda content: blobs.setdefault(hashlib.sha256(content).hexdigest(), content))
    folder = tmp_path / "data"
    (folder / "images").mkdir(parents=True)
    (folder / "images/0.jpg").write_bytes(b"picture")
    (folder / "log.csv").write_text("a,b\n")
    (tmp_path / "same.csv").write_text("a,b\n")
    told = [sender.take(path) for path in (folder / "log.csv", tmp_path / "same.csv", folder, tmp_path / "nothing")]
    assert told[0]["hash"] == told[1]["hash"] and told[3] is None and len(sender.sent) == 2
    asked = []

    def get(name):
        asked.append(name)
        return sender.sent[name]

    places = [_files.place(each, get) for each in told[:3]] + [_files.place(told[2], get)]
    assert open(places[0]).read() == "a,b\n" and os.path.basename(places[1]) == "same.csv"
    assert open(places[2] + "/images/0.jpg", "rb").read() == b"picture" and places[2] == places[3]
    assert asked.count(told[2]["hash"]) == 1
    (folder / "log.csv").write_text("other\n")
    assert sender.take(folder / "log.csv")["hash"] != told[0]["hash"]
    monkeypatch.setattr(_files, "LARGEST", 3)
    (tmp_path / "large.csv").write_text("a,b\n")
    with pytest.raises(pdk.Error, match="--shared"):
        sender.take(tmp_path / "large.csv")
