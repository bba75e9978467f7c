"""Workers on a cluster of Ray: three nodes on this machine. Skipped without Ray."""

import asyncio
import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

pytest.importorskip("ray", reason="ray is missing; `pip install 'pdk-perturb[ray]'`")
os.environ["RAY_AUTH_MODE"] = "disabled"
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

from ray.cluster_utils import Cluster  # noqa: E402

import ray  # noqa: E402

import pdk_perturb as pdk  # noqa: E402
from pdk_perturb._ray_worker import Ended, Worker  # noqa: E402
from pdk_perturb.ray import PATIENCE, Head, Paths, Pool, gpus, options  # noqa: E402

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
    # The record names the file by its place on the session's machine.
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


KILLER = """
import os, signal, sys

process = os.getpid()
while True:
    process = int(open(f"/proc/{process}/stat").read().rpartition(")")[2].split()[1])
    command = open(f"/proc/{process}/cmdline", "rb").read().replace(b"\\0", b" ").decode().strip()
    if command.startswith("ray::") if sys.argv[1] == "actor" else command.endswith("pdk worker"):
        os.kill(process, signal.SIGKILL)
        sys.exit()
"""


def test_a_job_that_always_kills_its_worker_is_an_error_and_the_others_are_driven(cluster, tmp_path):
    (tmp_path / "killer.py").write_text(KILLER)
    last = {"actor": "The actor is dead because its worker process has died", "worker": "`pdk worker` ended with exit code -9"}
    drivers = {who: {"name": "process", "command": ["python3", str(tmp_path / "killer.py"), who]} for who in last}
    scenarios = [{"name": who, "driver": driver} for who, driver in drivers.items()]
    scenarios += [{"name": "other", "driver": "lane_keeper", "repeat": number} for number in range(4)]
    pool = f"ray --slots 3 --address {cluster.address}"
    with pdk.Session(simulator="lane", duration=1, out=tmp_path / "out", pool=pool) as session:
        session.drive(scenarios)
    lines = pdk.Record(tmp_path / "out").lines()
    assert sorted(line["cause"] for line in lines) == ["error"] * 2 + ["time_out"] * 4
    for line in lines:
        if (reason := last.get(line["name"])) is not None:
            assert line["error_kind"] == "lost" and pdk.Record(tmp_path / "out").events(line["id"])[-1][1] == line["error"]
            assert line["error"] == f"a worker of the cluster was lost 3 times over it (the last: {reason})"


def test_a_run_whose_head_is_killed_ends_with_a_sentence(cluster, study, tmp_path, monkeypatch):
    own = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    own.wait_for_nodes()
    # The head counts as gone after three quarters of this.
    monkeypatch.setenv(PATIENCE, "20")
    killed = []

    def kill(frames, of):
        if frames > 0 and not killed:
            killed.append(frames)
            for processes in own.head_node.all_processes.values():
                for each in processes:
                    os.kill(each.process.pid, signal.SIGKILL)

    settings = {"mode": "realtime", "duration": 10, "scenarios": 60}
    says = f"the head of the cluster at {own.address} has not answered for 1[5-9] s; start it again, and continue the run with --out"
    with pytest.raises(pdk.Error, match=says) as raised:
        study("out", settings, pool=f"ray --slots 1 --address {own.address}", progress=kill)
    assert killed and len(pdk.Record(raised.value.record).lines()) < 60
    # Now it is one that never answered.
    with pytest.raises(pdk.Error, match=says):
        study("out", settings, pool=f"ray --slots 1 --address {own.address}")


def test_a_head_that_answers_is_left_alone():
    asked, said, left = threading.Semaphore(0), [], threading.Event()

    def ask():
        asked.release()

    with Head(ask, said.append, "the head", 3600, leave=lambda _: left.set()):
        assert asked.acquire(timeout=60)
    assert not said and not left.is_set()

    def fail():
        raise OSError("no route")

    for ask in (fail, None):
        left.clear()
        with Head(ask, said.append, "the head", 0.1, leave=lambda _: left.set()):
            assert left.wait(60)
    assert len(said) == 2 and all("the head has not answered for 0 s" in each or "for 1 s" in each for each in said)


LOCAL = """
import os, sys
import pdk_perturb as pdk

def below(process):
    for each in filter(str.isdigit, os.listdir("/proc")):
        try:
            parent = int(open(f"/proc/{each}/stat").read().rpartition(")")[2].split()[1])
        except OSError:
            continue
        if parent == process:
            yield each
            yield from below(int(each))

def listening():
    sockets = set()
    for process in below(os.getpid()):
        try:
            links = [os.readlink(f"/proc/{process}/fd/{fd}") for fd in os.listdir(f"/proc/{process}/fd")]
        except OSError:
            continue
        sockets.update(link[8:-1] for link in links if link.startswith("socket:["))
    for table in ("tcp", "tcp6"):
        for line in open(f"/proc/net/{table}").readlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in sockets:
                yield fields[1].partition(":")[0]

seen = []
def progress(frames, of):
    if not seen:
        seen.extend(listening())

pdk.run("quickstart", {"levels": [1], "duration": 2}, out=sys.argv[1], pool="ray --slots 1 --address local", progress=progress)
print(len(seen), *sorted(set(seen)))
"""


def test_a_new_cluster_can_be_reached_from_this_machine_alone(tmp_path):
    environment = dict(os.environ)
    environment.pop("RAY_USAGE_STATS_ENABLED", None)
    command = [sys.executable, "-c", LOCAL, str(tmp_path / "out")]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stderr
    count, *addresses = ran.stdout.splitlines()[-1].split()
    # 127.0.0.1, also as an address of version 6.
    assert int(count) > 3 and set(addresses) <= {"0100007F", "0000000000000000FFFF00000100007F"}, ran.stdout


def test_a_cluster_without_the_package_is_one_sentence(cluster, tmp_path, study):
    (tmp_path / "bare/pdk_perturb").mkdir(parents=True)
    (tmp_path / "bare/pdk_perturb/__init__.py").write_text("raise ImportError('there is no pdk_perturb')")
    node = cluster.add_node(num_cpus=1, resources={"bare": 1}, env_vars={"PYTHONPATH": str(tmp_path / "bare")})
    options = f"""--address {cluster.address} --slots 1 --resources '{{"bare": 1}}'"""
    remedy = rf"3 times in a row .*there is no pdk_perturb.*; install pdk-perturb {pdk.__version__} on every machine"
    with pytest.raises(pdk.Error, match=remedy):
        study("out", pool=f"ray {options}")
    cluster.remove_node(node)


class Actors:
    """Stands in for Ray: `start(number)` and `work(job)` are what actors do, the one with this number and with this job."""

    def __init__(self, monkeypatch, start=None, work=None, slots=4):
        self.started = self.alive = 0
        self.said = []
        self._start = start or self._ready
        self._work = work or self._done
        monkeypatch.setattr(ray, "remote", lambda cls: self)
        monkeypatch.setattr(ray, "put", lambda content: content)
        monkeypatch.setattr(ray, "kill", self._kill)
        ready = {"pdk": pdk.__version__, "catalog": []}
        self.pool = Pool(b"{}", ready, options(["--shared"]), slots, lambda line: self.said.append(json.loads(line)))

    def options(self, **_):
        return self

    def remote(self, *_):
        self.started += 1
        self.alive += 1
        return Handle(self.started, self)

    def _kill(self, _):
        self.alive -= 1

    async def _ready(self, number):
        return json.dumps({"ready": {"pdk": pdk.__version__, "catalog": []}})

    async def _done(self, job):
        return [json.dumps({"done": {"number": job["number"], "answer": {"made": {}}}})], None

    async def give(self, *jobs):
        """Gives jobs, each a number and a share of a GPU, and waits until nothing happens any more."""
        for number, share in jobs:
            component = {"name": "process", "parameters": {"gpus": share}}
            job = {"number": number, "slot": 0, "work": {"make": {"kind": "driver", "component": component}}}
            self.pool.take(json.dumps({"job": job}))
        for _ in range(1000):
            if not self.pool._running:
                return
            await asyncio.sleep(0.001)
        raise AssertionError(f"this goes on for ever: {self.said}")


class Handle:
    def __init__(self, number, actors):
        self.start = Method(lambda blobs: actors._start(number))
        self.work = Method(lambda job, files, blobs: actors._work(json.loads(job)["job"]))


class Method:
    def __init__(self, remote):
        self.remote = remote


def test_a_job_over_which_workers_are_lost_again_and_again_is_answered_as_lost(monkeypatch):
    tries = []

    async def work(job):
        if job["number"] != 7:
            return await actors._done(job)
        tries.append(job)
        raise ray.exceptions.ActorDiedError()

    actors = Actors(monkeypatch, work=work)
    asyncio.run(actors.give((7, 0), (8, 0)))
    sentence = "a worker of the cluster was lost 3 times over it (the last: The actor died unexpectedly before finishing this task)"
    lost = {"done": {"number": 7, "answer": {"failed": {"kind": "lost", "message": sentence}}}}
    assert len(tries) == 3 and lost in actors.said and len(actors.said) == 2


def test_what_is_raised_in_an_actor_is_no_lost_worker(monkeypatch):
    tries = []

    async def work(job):
        tries.append(job)
        raise ray.exceptions.RayTaskError("work", "Traceback\nOSError: no space left", OSError("no space left"))

    actors = Actors(monkeypatch, work=work)
    asyncio.run(actors.give((0, 0)))
    assert len(tries) == 1 and actors.said == [{"failed": "the pool of Ray cannot go on: OSError: no space left"}]


def test_what_a_worker_says_is_passed_on_as_it_is(monkeypatch, tmp_path):
    script = tmp_path / "pdk"
    monkeypatch.setattr(pdk, "executable", lambda: script)
    answers = [json.dumps({"ready": {}}), json.dumps({"failed": "no such thing; do another"})]
    script.write_text("#!/bin/sh\n" + "".join(f"read line\necho '{answer}'\n" for answer in answers))
    script.chmod(0o755)
    job = json.dumps({"job": {"number": 0, "slot": 0, "work": {"make": {}}}})
    worker = Worker('{"hello":{}}', [], True)
    assert json.loads(worker.start({})) == {"ready": {}}
    assert worker.work(job, [], {}) == ([answers[1] + "\n"], None)
    for _ in range(2):
        with pytest.raises(Ended, match="`pdk worker` ended with exit code 0"):
            worker.work(job, [], {})

    async def start(number):
        return answers[1] + "\n"

    actors = Actors(monkeypatch, start=start)
    asyncio.run(actors.give((0, 0)))
    assert actors.said == [json.loads(answers[1])]


def test_starts_that_fail_are_counted_until_one_succeeds(monkeypatch):
    failing = set()

    async def start(number):
        if number in failing:
            raise ray.exceptions.ActorDiedError()
        return await actors._ready(number)

    async def work(job):
        if job["number"] % 2:
            raise ray.exceptions.ActorDiedError()
        return await actors._done(job)

    actors = Actors(monkeypatch, start=start, work=work, slots=1)
    # Each loss of the actor asks for another, two of which fail before one starts.
    failing.update({1, 2, 4, 5, 7, 8})
    asyncio.run(actors.give((1, 0)))
    assert actors.started == 9 and list(actors.said[0]) == ["done"]
    failing.update(range(10, 100))
    asyncio.run(actors.give((2, 0)))
    remedy = f"(the last: The actor died unexpectedly before finishing this task); install pdk-perturb {pdk.__version__} on every machine"
    assert actors.started == 12 and actors.said[1]["failed"].endswith(remedy)
    # A machine that takes several along is one failure.
    actors = Actors(monkeypatch, start=start, slots=8)
    failing.clear()
    failing.update(range(1, 9))
    asyncio.run(actors.give(*((2 * number, 0) for number in range(8))))
    assert [list(said) for said in actors.said] == [["done"]] * 8


def test_as_many_actors_are_let_go_as_are_missing(monkeypatch):
    async def work(job):
        await asyncio.sleep(0.01)
        return await actors._done(job)

    async def study():
        await actors.give((0, 0), (1, 0), (2, 0))
        assert (actors.started, actors.alive) == (3, 3)
        # There is room for one.
        await actors.give((3, 1))
        assert (actors.started, actors.alive) == (4, 4)
        await actors.give((4, 1), (5, 1))
        assert (actors.started, actors.alive) == (5, 4)
        await actors.give((6, 0), (7, 0))
        assert (actors.started, actors.alive) == (5, 4)

    actors = Actors(monkeypatch, work=work, slots=4)
    asyncio.run(study())
    assert len(actors.said) == 8


def test_an_actor_that_cannot_be_placed_gets_the_room_of_one_with_nothing_to_do(monkeypatch):
    async def start(number):
        while actors.alive > 2:
            await asyncio.sleep(0.001)
        return await actors._ready(number)

    async def study():
        await actors.give((0, 0.5), (1, 0.5))
        await actors.give((2, 1))
        assert (actors.started, actors.alive) == (3, 2)

    monkeypatch.setattr("pdk_perturb.ray.ROOM", 0.02)
    actors = Actors(monkeypatch, start=start, slots=8)
    asyncio.run(study())
    assert len(actors.said) == 3


def test_a_mistake_is_one_sentence(cluster, study):
    with pytest.raises(pdk.Error, match="ended before it was ready"):
        study("out", pool="ray --slots 0")


def test_paths_in_a_job_are_found_by_descriptions():
    parameter = {"doc": "", "unit": ""}
    catalog = [
        {"description": {"kind": kind, "name": name, "parameters": [{**parameter, "name": n, "type": t} for n, t in given.items()]}}
        for kind, name, given in [
            ("driver", "onnx", {"model": "path", "engine": "text"}),
            ("simulator", "process", {"command": "json", "gpus": "number"}),
            ("perturbation", "repaint", {"model": "path"}),
            ("saliency", "hirescam", {"model": "path"}),
            ("dataset", "tub", {"path": "path"}),
        ]
    ]
    where = {"top": 20, "by": {"name": "hirescam", "parameters": {"model": "s.onnx"}}}
    applied = {"name": "repaint", "level": 1, "parameters": {"model": "r.onnx"}, "region": {"mask": "m.png"}, "where": where}
    simulator = {"name": "process", "parameters": {"command": ["python3", "town.py", "--fast"], "gpus": 0.25}}
    driver = {"name": "onnx", "parameters": {"model": "p.onnx", "engine": "m.png"}}
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
    dataset = {"name": "tub", "parameters": {"path": "data"}}
    frames = {"dataset": dataset, "driver": driver, "perturbation": applied, "seed": 0, "sequence": 0, "from": 0, "start": 0, "end": 9}
    steps, _ = found({"evaluate": frames})
    assert len(steps) == 5
    assert options(["--slots", "3", "--resources", '{"simulators": 1}']).resources == {"simulators": 1}


def test_files_travel_once_and_arrive_as_they_were(tmp_path, monkeypatch):
    from pdk_perturb import _files

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

    def lost(name):
        raise OSError("no space left")

    with pytest.raises(OSError):
        _files.place({"name": "new.csv", "hash": "0" * 64, "folder": False}, lost)
    assert not list((tmp_path / "cache").rglob(".part-*"))
    (folder / "log.csv").write_text("other\n")
    assert sender.take(folder / "log.csv")["hash"] != told[0]["hash"]
    monkeypatch.setattr(_files, "LARGEST", 3)
    (tmp_path / "large.csv").write_text("a,b\n")
    with pytest.raises(pdk.Error, match="--shared"):
        sender.take(tmp_path / "large.csv")
