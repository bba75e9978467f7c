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
from types import SimpleNamespace

import pytest

pytest.importorskip("ray", reason="ray is missing; `pip install 'pdk-perturb[ray]'`")
os.environ["RAY_AUTH_MODE"] = "disabled"
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

from ray.cluster_utils import Cluster  # noqa: E402

import ray  # noqa: E402

import pdk_perturb as pdk  # noqa: E402
from pdk_perturb import _ray_worker  # noqa: E402
from pdk_perturb._ray_worker import Ended, Relay, Worker, digest  # noqa: E402
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


def test_a_trace_has_the_id_of_the_record_if_a_script_travels(cluster, tmp_path):
    (tmp_path / "pilot.py").write_text("raise SystemExit(3)")
    driver = {"name": "process", "command": ["python3", str(tmp_path / "pilot.py")]}
    ids = []
    for out, pool in (("here", None), ("there", f"ray --slots 1 --address {cluster.address}")):
        with pdk.Session(simulator="lane", driver=driver, duration=1, seed=1, out=tmp_path / out, pool=pool) as session:
            assert session.drive([{}])[0]["cause"] == "error"
        identity = session.record.lines()[0]["id"]
        # What is in a trace besides differs: the error names the script where it lies on that machine.
        assert identity.encode() in (tmp_path / out / f"traces/{identity}.mcap").read_bytes()
        ids.append(identity)
    assert ids[0] == ids[1]


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
    """Stands in for Ray: `start(number)` and `work(job)` are what actors do, the one with this number and with this job. Each is on a machine of
    its own unless `node(number)` says otherwise. Relays are real, and in this process."""

    def __init__(self, monkeypatch, start=None, work=None, node=int, slots=4, chosen=("--shared",)):
        self.started = self.alive = 0
        self.said = []
        #: How many jobs came with each message to a relay, and how many answers with each that came back.
        self.given, self.taken = [], []
        self.relays = []
        self.ready = json.dumps({"ready": {"pdk": pdk.__version__, "catalog": []}})
        self._start = start or self._ready
        self._work = work or self._done
        self._node = node
        monkeypatch.setattr(ray, "remote", lambda cls: Made(self._worker if cls is Worker else self._relay))
        monkeypatch.setattr(ray, "put", lambda content: content)
        monkeypatch.setattr(ray, "kill", lambda handle: handle.kill())
        ready = {"pdk": pdk.__version__, "catalog": []}
        self.pool = Pool(b"{}", ready, options(list(chosen)), slots, self._say)

    def _say(self, text):
        self.said += map(json.loads, text.splitlines())

    def _worker(self, *_):
        self.started += 1
        self.alive += 1
        return Handle(self.started, self)

    def _relay(self):
        self.relays.append(Relayed(self))
        return self.relays[-1]

    async def _ready(self, number):
        return self.ready

    async def _done(self, job):
        return json.dumps({"done": {"number": job["number"], "answer": {"made": {}}}}), None, False

    def put(self, *jobs):
        """Gives jobs, each a number and a share of a GPU, which come together."""

        def line(number, share):
            component = {"name": "process", "parameters": {"gpus": share}}
            job = {"number": number, "slot": 0, "work": {"make": {"kind": "driver", "component": component}}}
            return json.dumps({"job": job}).encode()

        self.pool.take([line(*job) for job in jobs])

    async def give(self, *jobs):
        """Gives jobs, and waits until nothing happens any more."""
        self.put(*jobs)
        for _ in range(1000):
            if not self.pool._running and not any(actor.job for actor in self.pool._actors):
                return
            await asyncio.sleep(0.001)
        raise AssertionError(f"this goes on for ever: {self.said}")


class Made:
    def __init__(self, remote):
        self.remote = remote

    def options(self, **_):
        return self


class Method(Made):
    """A method that another process would execute."""

    def __init__(self, function, process=None):
        def remote(*given):
            call = asyncio.ensure_future(function(*given))
            if process is not None:
                process.calls.add(call)
                call.add_done_callback(process.calls.discard)
            return call

        super().__init__(remote)


class Handle:
    def __init__(self, number, actors):
        self._actors = actors

        async def start(blobs):
            # The id of a machine has 28 bytes.
            return digest(await actors._start(number)), f"{actors._node(number):056x}"

        async def work(line, slot, files, blobs):
            return await actors._work({**json.loads(line)["job"], "slot": slot, "actor": number})

        self.start = Method(start)
        self.said = Method(lambda: actors._start(number))
        self.work = Method(work)

    def kill(self):
        self._actors.alive -= 1


class Relayed:
    """A relay, which `lose` ends as the loss of its machine does."""

    def __init__(self, actors):
        self.calls = set()
        self._lost = False
        relay = Relay()

        async def give(jobs):
            actors.given.append(len(jobs))
            await relay.give(jobs)

        async def take(*given):
            if self._lost:
                raise ray.exceptions.ActorDiedError()
            try:
                answers = await relay.take(*given)
            except asyncio.CancelledError:
                if self._lost:
                    raise ray.exceptions.ActorDiedError() from None
                raise
            actors.taken.append(len(answers))
            return answers

        self.ready, self.give, self.take = (Method(each, self) for each in (relay.ready, give, take))

    def lose(self):
        self._lost = True
        for call in self.calls:
            call.cancel()

    def kill(self):
        self.lose()


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
    monkeypatch.setattr(ray, "get_runtime_context", lambda: SimpleNamespace(get_node_id=lambda: "here"))
    answers = [json.dumps({"ready": {}}), json.dumps({"failed": "no such thing; do another"})]
    script.write_text("#!/bin/sh\n" + "".join(f"read line\necho '{answer}'\n" for answer in answers))
    script.chmod(0o755)
    job = json.dumps({"job": {"number": 0, "slot": 0, "work": {"make": {}}}})
    worker = Worker('{"hello":{}}', [], True)
    assert worker.start({}) == (digest(worker.said()), "here") and json.loads(worker.said()) == {"ready": {}}
    assert worker.work(job, 0, [], {}) == (answers[1], None, False)
    for _ in range(2):
        with pytest.raises(Ended, match="`pdk worker` ended with exit code 0"):
            worker.work(job, 0, [], {})

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


def test_jobs_and_answers_that_are_there_at_the_same_time_go_together(monkeypatch):
    async def study():
        await actors.give(*((number, 0) for number in range(8)))
        actors.given.clear(), actors.taken.clear()
        await actors.give(*((number, 0) for number in range(8, 16)))

    actors = Actors(monkeypatch, node=lambda number: number % 2, slots=8)
    asyncio.run(study())
    assert len(actors.relays) == 2 and actors.given == [4, 4] and actors.taken == [4, 4]
    assert sorted(said["done"]["number"] for said in actors.said) == list(range(16))


def test_an_answer_does_not_wait_for_a_job_that_takes_longer(monkeypatch):
    async def work(job):
        if job["number"] == 0:
            await longest.wait()
        return await actors._done(job)

    async def study():
        nonlocal longest
        longest = asyncio.Event()
        actors.put(*((number, 0) for number in range(4)))
        while len(actors.said) < 3:
            await asyncio.sleep(0.001)
        assert sorted(said["done"]["number"] for said in actors.said) == [1, 2, 3]
        longest.set()
        await actors.give((4, 0))

    longest = None
    actors = Actors(monkeypatch, work=work, node=lambda _: 0)
    asyncio.run(asyncio.wait_for(study(), 60))
    assert [said["done"]["number"] for said in actors.said[3:]] in ([0, 4], [4, 0])


def test_slots_do_one_job_at_a_time_in_the_order_of_the_session(monkeypatch):
    busy, order = set(), []

    async def work(job):
        assert job["slot"] not in busy
        busy.add(job["slot"])
        order.append(job["number"])
        await asyncio.sleep(0.0001 * (job["number"] % 7))
        busy.remove(job["slot"])
        return await actors._done(job)

    actors = Actors(monkeypatch, work=work, node=lambda number: number % 3, slots=6)
    asyncio.run(actors.give(*((number, 0) for number in range(200))))
    assert sorted(order) == list(range(200)) and sorted(said["done"]["number"] for said in actors.said) == list(range(200))
    # As many as there are slots are under way, so none is more than that before its turn.
    assert all(abs(place - number) < 2 * 6 for place, number in enumerate(order))


def test_a_worker_that_is_lost_in_a_batch_costs_the_others_nothing(monkeypatch):
    done, lost = [], []

    async def work(job):
        if job["number"] == 2 and not lost:
            lost.append(job)
            raise ray.exceptions.ActorDiedError()
        done.append(job["number"])
        return await actors._done(job)

    actors = Actors(monkeypatch, work=work, node=lambda _: 0, slots=5)
    asyncio.run(actors.give(*((number, 0) for number in range(5))))
    assert sorted(done) == list(range(5)) and sorted(said["done"]["number"] for said in actors.said) == list(range(5))
    # The one that is ready first takes the job.
    assert lost and actors.alive == actors.started - 1 and len(actors.relays) == 1


def test_the_jobs_of_a_machine_that_is_lost_are_done_elsewhere(monkeypatch):
    async def work(job):
        # What runs on the first machine has no end.
        if job["actor"] % 2:
            await asyncio.sleep(3600)
        return await actors._done(job)

    async def study():
        actors.put(*((number, 0) for number in range(6)))
        while len(actors.said) < 3 or len(actors.relays) < 2:
            await asyncio.sleep(0.001)
        first = next(hub.handle for hub in actors.pool._hubs.values() if any(actor.job for actor in hub.actors.values()))
        actors._node = lambda number: 1
        actors.started += actors.started % 2
        monkeypatch.setattr(actors, "_worker", even)
        first.lose()
        await actors.give((6, 0))

    def even(*_):
        actors.started += 2
        actors.alive += 1
        return Handle(actors.started, actors)

    actors = Actors(monkeypatch, work=work, node=lambda number: number % 2, slots=6)
    asyncio.run(asyncio.wait_for(study(), 60))
    assert sorted(said["done"]["number"] for said in actors.said) == list(range(7))
    assert sorted(actors.pool._numbers + [actor.number for actor in actors.pool._actors]) == list(range(6))


def test_a_job_with_which_machines_are_lost_again_and_again_is_answered_as_lost(monkeypatch):
    async def work(job):
        actors.relays[-1].lose()
        await asyncio.sleep(3600)

    actors = Actors(monkeypatch, work=work, slots=1)
    asyncio.run(actors.give((3, 0)))
    (said,) = actors.said
    sentence = "a worker of the cluster was lost 3 times over it (the last: The actor died unexpectedly before finishing this task)"
    assert said == {"done": {"number": 3, "answer": {"failed": {"kind": "lost", "message": sentence}}}} and len(actors.relays) == 3


def test_machines_share_relays_if_there_are_many(monkeypatch):
    monkeypatch.setattr("pdk_perturb.ray.RELAYS", 2)
    actors = Actors(monkeypatch, slots=6)
    asyncio.run(actors.give(*((number, 0) for number in range(6))))
    assert (len(actors.relays), actors.started, len(actors.said)) == (2, 6, 6)
    assert sorted(len(hub.actors) for hub in set(actors.pool._hubs.values())) == [3, 3]


def test_traces_are_there_before_their_answers(monkeypatch, tmp_path):
    async def work(job):
        said, _, _ = await actors._done(job)
        return said, str(job["number"]).encode(), False

    def say(text):
        for line in map(json.loads, text.splitlines()):
            number = line["done"]["number"]
            assert (tmp_path / f"{number}.mcap").read_text() == str(number)
            actors.said.append(line)

    async def study():
        actors.pool.take(
            json.dumps({"job": {"number": number, "slot": 0, "work": {"drive": {"trace": str(tmp_path / f"{number}.mcap")}}}}).encode()
            for number in range(20)
        )
        while len(actors.said) < 20:
            await asyncio.sleep(0.001)

    actors = Actors(monkeypatch, work=work, node=lambda _: 0)
    actors.pool._say = say
    asyncio.run(asyncio.wait_for(study(), 60))
    assert len(list(tmp_path.iterdir())) == 20


def test_a_relay_that_misses_jobs_reports_that(monkeypatch):
    monkeypatch.setattr(_ray_worker, "LONGEST", 0.01)

    async def study():
        relay = Relay()
        assert await relay.take(0, 0) == []
        with pytest.raises(_ray_worker.Missing, match="2 jobs"):
            await relay.take(2, 0)

    asyncio.run(study())


def test_traces_come_a_few_at_a_time_if_they_are_large(monkeypatch):
    monkeypatch.setattr(_ray_worker, "MOST", 20)
    worker = SimpleNamespace(work=Method(lambda line, slot, files, blobs: asyncio.sleep(0, ("done", b"x" * 8, False))))

    async def study():
        relay = Relay()
        await relay.give([(slot, worker, b"", (), {}) for slot in range(7)])
        while len(relay._finished) < 7:
            await asyncio.sleep(0)
        return [len(await relay.take(7, 0)) for _ in range(3)]

    assert asyncio.run(study()) == [3, 3, 1]


def test_a_job_shows_whether_it_needs_a_gpu_or_files(monkeypatch, tmp_path):
    (tmp_path / "mask.png").write_bytes(b"mask")
    actors = Actors(monkeypatch, chosen=())
    drive = {"simulator": {"name": "lane"}, "driver": {"name": "lane_keeper"}, "perturbations": [{"name": "fog_filter", "level": 1}]}

    def read(**more):
        return actors.pool._read(json.dumps({"job": {"number": 0, "slot": 0, "work": {"drive": {"scenario": {**drive, **more}}}}}).encode())

    assert read() == (0.0, ())
    assert read(driver={"name": "process", "parameters": {"command": ["pilot"], "gpus": 0.5}}) == (0.5, [])
    group, files = read(perturbations=[{"name": "fog_filter", "level": 1, "region": {"mask": str(tmp_path / "mask.png")}}])
    assert group == 0.0 and [told["name"] for _, told in files] == ["mask.png"]
    (tmp_path / "part.lua").write_text("return {}")
    where = {"mask": {"name": str(tmp_path / "part.lua")}}
    _, files = read(perturbations=[{"name": "fog_filter", "level": 1, "where": where}])
    assert [(steps[-3:], told["name"]) for steps, told in files] == [(("where", "mask", "name"), "part.lua")]


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
            ("mask", "segmentation", {"model": "path"}),
            ("dataset", "tub", {"path": "path"}),
        ]
    ]
    where = {"top": 20, "by": {"name": "hirescam", "parameters": {"model": "s.onnx"}}}
    applied = {"name": "repaint", "level": 1, "parameters": {"model": "r.onnx"}, "region": {"mask": "m.png"}, "where": where}
    masked = [
        {"name": "repaint", "level": 1, "where": {"mask": {"name": name, "parameters": {"model": "m.onnx"}}}} for name in ("below.lua", "segmentation")
    ]
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
    steps, _ = found({"drive": {"scenario": {**scenario, "perturbations": masked}, "name": "x", "trace": "/runs/x.mcap"}})
    assert steps[-2:] == [
        '["scenario", "perturbations", 0, "where", "mask", "name"]',
        '["scenario", "perturbations", 1, "where", "mask", "parameters", "model"]',
    ]
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
