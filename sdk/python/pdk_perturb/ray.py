"""`--pool ray`: workers on a cluster of Ray.

    pdk run study --pool ray
    pdk run study --pool "ray --address head:6379 --slots 200"
    pdk.run("study", pool="ray")

Where they run, how often they are tried and how many machines there are is Ray's business. Each is an actor that holds a `pdk worker`. A
few more actors, the relays, pass on jobs and answers, so that those that are there at the same time are one message. The package pdk-perturb has to be there on every machine, in the same version; what else a scenario needs (models, plugins, scripts, datasets) travels
by its content, once to each machine, and traces come back. With `--shared` nothing travels: all machines have the same files at the same
paths, as on a shared file system.

This is a pool as docs/worker-protocol.md describes it, on standard input and output.
"""

import argparse
import asyncio
import heapq
import itertools
import json
import os
import subprocess
import sys
import threading
import time
from collections import Counter, deque
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from pdk_perturb import _files, _program
from pdk_perturb._pdk import Error
from pdk_perturb._ray_worker import Relay, Worker, reason

#: How often a job is given to an actor that is lost over it, and how many starts in a row may fail.
TRIES = 3
#: After this many seconds an actor that does not start is taken to wait for what others hold, such as a GPU.
ROOM = 5.0
#: This many seconds lie between two questions to the head of the cluster.
BEAT = 2.0
#: There are at most this many relays. If there are more machines, several share one.
RELAYS = 8
#: At most this many messages a second go to all relays together, and as many come back. What is there in between goes together.
MESSAGES = 500.0
#: This many threads write traces, which for the most part is waiting for the disk.
WRITERS = 8
#: The variable of Ray's that says how many seconds a program waits for a head that is gone, and what it is if it is not set. Then
#: Ray ends the program without a word, so the pool gives up after three quarters of that.
PATIENCE, USUAL_PATIENCE = "RAY_gcs_rpc_server_reconnect_timeout_s", 60.0


def options(words):
    """What stands behind `ray` in `--pool`."""
    parser = argparse.ArgumentParser(prog="--pool ray", description="Workers on a cluster of Ray.")
    parser.add_argument("--address", help="the cluster's address, or local for a new one; else RAY_ADDRESS, else one on this machine, else a new one")
    parser.add_argument("--slots", type=int, help="workers at most; else as many as the cluster has processors for")
    parser.add_argument("--cpus", type=float, default=1.0, help="processors of a worker [default: 1]")
    parser.add_argument("--resources", type=json.loads, default={}, help="further resources of a worker, as JSON")
    parser.add_argument("--working-dir", help="a folder that Ray brings to all machines, for modules that drivers import")
    parser.add_argument("--shared", action="store_true", help="all machines have the same files at the same paths")
    chosen = parser.parse_args(words)
    if chosen.slots is not None and chosen.slots < 1:
        parser.error("--slots has to be at least 1")
    return chosen


class Paths:
    """Where the paths are in a job: what the descriptions of components say are paths, and what a program is started with."""

    def __init__(self, catalog):
        self._types = {}
        for entry in catalog:
            description = entry["description"]
            types = {parameter["name"]: parameter["type"] for parameter in description["parameters"]}
            self._types[description["kind"], description["name"]] = types

    def find(self, job):
        """The places in a job that hold paths, as steps from its root."""
        work = job["job"]["work"]
        ((kind, given),) = work.items()
        root = ("job", "work", kind)
        if kind == "make":
            yield from self._component(given["kind"], given["component"], (*root, "component"))
            return
        spec = given
        if kind == "drive":
            spec, root = given["scenario"], (*root, "scenario")
        for name in ("simulator", "driver", "dataset"):
            if name in spec:
                yield from self._component(name, spec[name], (*root, name))
        places = [((*root, "perturbations", number), applied) for number, applied in enumerate(spec.get("perturbations", []))]
        if "predictor" in spec:
            yield from self._component("predictor", spec["predictor"]["component"], (*root, "predictor", "component"))
        if "perturbation" in spec:
            places.append(((*root, "perturbation"), spec["perturbation"]))
        for place, applied in places:
            yield from self._component("perturbation", applied, place)
            region = applied.get("region")
            if isinstance(region, dict) and "mask" in region:
                yield (*place, "region", "mask")
            for modifier, parts in (("where", {"by": "saliency", "mask": "mask"}), ("attention", {"by": "saliency"})):
                for part, of in parts.items():
                    component = (applied.get(modifier) or {}).get(part)
                    if not isinstance(component, dict):
                        continue
                    # A mask may be a script of the user's, by its path.
                    if of == "mask" and os.path.splitext(component["name"])[1] == ".lua":
                        yield (*place, modifier, part, "name")
                    yield from self._component(of, component, (*place, modifier, part))

    def _component(self, kind, component, place):
        types = self._types.get((kind, component["name"]), {})
        for name, value in component.get("parameters", {}).items():
            if types.get(name) == "path" and isinstance(value, str):
                yield (*place, "parameters", name)
            elif name in ("command", "launch") and isinstance(value, list):
                # The program itself is for each machine to have.
                yield from ((*place, "parameters", name, word) for word in range(1, len(value)))


def at(value, steps):
    """A value within a value."""
    for step in steps:
        value = value[step]
    return value


def gpus(job):
    """How much of a GPU the simulator and the driver of a job need together."""
    work = job["job"]["work"]
    ((kind, given),) = work.items()
    if kind == "make":
        components = [given["component"]]
    else:
        spec = given["scenario"] if kind == "drive" else given
        components = [spec[name] for name in ("simulator", "driver") if name in spec]
        components += [spec["predictor"]["component"]] if "predictor" in spec else []
    return sum(float(component.get("parameters", {}).get("gpus", 0)) for component in components)


def introduced(hello):
    """What a worker of this machine says to hello: the catalog of the session's machine, whose files the session reads."""
    from pdk_perturb import executable

    child = subprocess.Popen([str(executable()), "worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        child.stdin.write(hello)
        child.stdin.flush()
        line = child.stdout.readline()
    finally:
        child.stdin.close()
        child.wait()
    if not line:
        raise SystemExit("a worker of this machine ended before it was ready")
    return json.loads(line)


def given_up(message):
    """The answer to a job over which workers are lost again and again; that of a scenario is an error."""
    return {"failed": {"kind": "lost", "message": message}}


class Head:
    """The head of the cluster, without which Ray does nothing and reports nothing: calls only wait. Another thread asks it again and
    again whether it is there, by `ask`; without that, the caller waits for the first answer. If none comes for `patience`
    seconds, the pool says so and ends."""

    def __init__(self, ask, say, name, patience, leave=os._exit):
        self._ask = ask
        self._say = say
        self._name = name
        self._patience = patience
        self._leave = leave
        self._answered = time.monotonic()
        self._over = threading.Event()

    def __enter__(self):
        for target in (self._watch, self._listen) if self._ask else (self._watch,):
            threading.Thread(target=target, daemon=True).start()
        return self

    def __exit__(self, *_):
        self._over.set()

    def _listen(self):
        while not self._over.is_set():
            try:
                self._ask()
                self._answered = time.monotonic()
            except Exception:
                pass  # Only an answer counts.
            self._over.wait(BEAT)

    def _watch(self):
        while not self._over.wait(BEAT / 4):
            silent = time.monotonic() - self._answered
            if silent < self._patience:
                continue
            self._over.set()
            self._say(
                json.dumps(
                    {
                        "failed": f"the pool of Ray cannot go on: {self._name} has not answered for {silent:.0f} s; start it again, and "
                        "continue the run with --out and the folder of its record"
                    }
                )
            )
            # Whatever is asked of Ray now waits without end.
            self._leave(1)


def patience():
    """After how many seconds without an answer the head of a cluster counts as gone."""
    try:
        return 0.75 * float(os.environ.get(PATIENCE, USUAL_PATIENCE))
    except ValueError:
        return 0.75 * USUAL_PATIENCE


def connect(ray, chosen, say):
    """Connects to the cluster that was named, else to one of this machine, else to a new one that only this machine can reach."""
    environment = {} if chosen.working_dir is None else {"working_dir": chosen.working_dir}
    common = {"runtime_env": environment, "log_to_driver": True, "logging_level": "warning"}
    address = chosen.address or os.environ.get("RAY_ADDRESS")
    if address is None:
        try:
            # What was not ended well is found too.
            with Head(None, say, "the cluster of Ray that was found on this machine (`ray stop` forgets it)", patience()):
                ray.init(address="auto", **common)
            return
        except ConnectionError:
            address = "local"
    if address != "local":
        with Head(None, say, f"the head of the cluster at {address}", patience()):
            ray.init(address=address, **common)
        return
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    # Ray listens at the loopback interface alone if it takes the machine for one that cannot be part of a cluster. The variable, which it
    # has for such machines, is for the processes that it starts; here it has been read.
    os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
    ray._private.ray_constants.ENABLE_RAY_CLUSTER = False
    ray.init(address="local", include_dashboard=False, **common)


class Job:
    """A job: its line, its files, how often it was given away, and which one that was of all."""

    __slots__ = ("line", "files", "tries", "given")

    def __init__(self, line, files):
        self.line = line
        self.files = files
        self.tries = 0
        self.given = 0


class Actor:
    """An actor of the cluster, as the pool sees it."""

    def __init__(self, handle, number, group):
        self.handle = handle
        self.number = number
        self.group = group
        #: Where its jobs go through.
        self.hub = None
        #: Whether the relay has the handle.
        self.is_known = False
        #: What it does.
        self.job = None


class Hub:
    """A relay, as the pool sees it."""

    def __init__(self, handle):
        self.handle = handle
        #: A call without a result costs half as much. That the relay is gone is noticed where it is to answer.
        self.give = handle.give.options(num_returns=0)
        #: Done when it is there.
        self.ready = None
        #: The actors that it passes jobs to, by their numbers.
        self.actors = {}
        #: Jobs that go to it with the next message.
        self.outgoing = []
        #: How many jobs it was given.
        self.given = 0


class Group:
    """Workers with the same share of a GPU, and what waits for them."""

    def __init__(self):
        #: Jobs.
        self.waiting = deque()
        #: Actors that have nothing to do.
        self.idle = []
        #: How many are on their way.
        self.coming = 0


class Pool:
    """Gives the jobs of a session to actors."""

    def __init__(self, hello, ready, chosen, slots, say):
        import ray

        self._ray = ray
        self._hello = hello.decode()
        self._chosen = chosen
        self._say = say
        self._catalog = ready["catalog"]
        self._paths = Paths(self._catalog)
        self._sender = _files.Sender(ray.put)
        self._components = [] if chosen.shared else list(self._travelling())
        #: Hashes of what workers said of themselves that was found to be right.
        self._checked = set()
        self._groups = {}
        self._actors = set()
        #: Relays by the machines whose workers they serve.
        self._hubs = {}
        #: Those with jobs that go to them.
        self._outgoing = set()
        self._writers = ThreadPoolExecutor(WRITERS)
        #: Numbers that no actor has, the smallest first: a worker's ports are derived from its number.
        self._numbers = list(range(slots))
        #: Counts the times that jobs were given away.
        self._given = itertools.count()
        self._running = set()
        self._listening = set()
        #: How many starts failed, one behind the other.
        self._failed = 0

    def _travelling(self):
        """The files of all components that are not part of pdk, and whether each is one that a component of pdk or a plugin shows."""
        known = set()
        for entry in self._catalog:
            own = (entry.get("plugin") or {}).get("built_in") or entry.get("blake3") is not None
            base = entry.get("base")
            if (own and base is None) or entry["file"] in known:
                continue
            known.add(entry["file"])
            told = self._sender.take(entry["file"])
            if told is None:
                continue
            yield (base is not None, told)

    def take(self, lines):
        """Takes jobs of the session."""
        for line in lines:
            group, files = self._read(line)
            self._groups.setdefault(group, Group()).waiting.append(Job(line, files))
        self._give_all()

    def _read(self, line):
        """What a job needs: how much of a GPU, and files. Most need neither, which their text shows."""
        has_files = not self._chosen.shared and (b'"parameters"' in line or b'"mask"' in line)
        if not has_files and b'"gpus"' not in line:
            return 0.0, ()
        job, files = json.loads(line), []
        if has_files:
            for steps in self._paths.find(job):
                told = self._sender.take(at(job, steps))
                if told is not None:
                    files.append((steps, told))
        return float(gpus(job)), files

    def _blobs(self, files):
        return {told["hash"]: self._sender.sent[told["hash"]] for _, told in files}

    def _give(self, name):
        """Gives what waits in a group to actors that have nothing to do, and asks for more if there are too few."""
        group = self._groups[name]
        while group.waiting and group.idle:
            actor, job = group.idle.pop(), group.waiting.popleft()
            job.tries += 1
            job.given = next(self._given)
            actor.job = job
            handle = None if actor.is_known else actor.handle
            actor.is_known = True
            actor.hub.outgoing.append((actor.number, handle, job.line, job.files, self._blobs(job.files)))
            self._outgoing.add(actor.hub)
        # As many are on their way as there are jobs that wait for one.
        while len(group.waiting) - group.coming > len(self._numbers) and self._make_room(group):
            pass
        while len(group.waiting) > group.coming and self._numbers:
            group.coming += 1
            self._run(self._start(name, heapq.heappop(self._numbers)))

    def _make_room(self, group):
        """Lets an actor of another group go that has nothing to do. Whether there was one."""
        others = [other for other in self._groups.values() if other is not group and other.idle]
        if others:
            self._lose(max(others, key=lambda other: len(other.idle)).idle.pop())
        return bool(others)

    def _run(self, coroutine):
        task = asyncio.ensure_future(coroutine)
        self._running.add(task)
        task.add_done_callback(self._done)

    def _done(self, task):
        self._running.discard(task)
        self._listening.discard(task)
        if not task.cancelled() and task.exception() is not None:
            self.fail(task.exception())

    def fail(self, raised):
        """Says why nothing more can be done."""
        said = str(raised) if isinstance(raised, Error) else f"{type(raised).__name__}: {raised}"
        self._fail(said.strip().splitlines()[-1])

    def _fail(self, sentence):
        self._say(json.dumps({"failed": f"the pool of Ray cannot go on: {sentence}"}))

    async def _start(self, name, number):
        group = self._groups[name]
        remote = self._ray.remote(Worker).options(
            num_cpus=self._chosen.cpus, num_gpus=name or None, resources=self._chosen.resources or None
        )
        handle = remote.remote(self._hello, self._components, self._chosen.shared)
        actor = Actor(handle, number, name)
        self._actors.add(actor)
        failed_before = self._failed
        try:
            digest, node = await self._introduced(handle, group)
            if digest not in self._checked:
                line = await handle.said.remote()
                if "failed" in (said := json.loads(line)):
                    self._say(line.strip())
                    return
                self._check(said["ready"])
                self._checked.add(digest)
            actor.hub = await self._hub(node)
        except self._ray.exceptions.RayTaskError:
            # It is there, and cannot do it.
            raise
        except self._ray.exceptions.RayError as raised:
            # Another is asked for if it is still needed.
            self._lose(actor)
            # Several that are lost at once, with their machine, are one failure.
            self._failed += self._failed == failed_before
            if self._failed >= TRIES:
                raise self._unable(raised) from None
        else:
            self._failed = 0
            actor.hub.actors[number] = actor
            group.idle.append(actor)
        finally:
            group.coming -= 1
        self._give_all()

    async def _introduced(self, handle, group):
        """What a worker returns when it has started."""
        start = asyncio.ensure_future(handle.start.remote(self._blobs(self._components)))
        while not (await asyncio.wait([start], timeout=ROOM))[0]:
            self._make_room(group)
        return start.result()

    async def _hub(self, node):
        """The relay for a machine: one that is started there, or that of others if there are many."""
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        while True:
            hub = self._hubs.get(node)
            if hub is None:
                served = Counter(self._hubs.values())
                if len(served) < RELAYS:
                    there = NodeAffinitySchedulingStrategy(node_id=node, soft=False)
                    hub = Hub(self._ray.remote(Relay).options(num_cpus=0, scheduling_strategy=there).remote())
                    hub.ready = asyncio.ensure_future(self._open(hub))
                else:
                    hub = min(served, key=served.get)
                self._hubs[node] = hub
            await hub.ready
            # It may have been lost at the same moment.
            if self._hubs.get(node) is hub:
                return hub

    async def _open(self, hub):
        try:
            await hub.handle.ready.remote()
        except self._ray.exceptions.RayError:
            # The next worker asks for another.
            self._forget(hub)
            raise
        task = asyncio.ensure_future(self._listen(hub))
        self._listening.add(task)
        task.add_done_callback(self._done)

    async def _listen(self, hub):
        """Takes the answers of a relay until it is gone."""
        try:
            while True:
                self._answered(hub, await hub.handle.take.remote(hub.given, self.pause()))
        except self._ray.exceptions.RayError as raised:
            self._lose_hub(hub, reason(raised))

    def pause(self):
        """How many seconds lie between two messages to a relay, or from one, if there is much to say."""
        return len(self._listening) / MESSAGES

    def _forget(self, hub):
        self._hubs = {node: other for node, other in self._hubs.items() if other is not hub}

    def _unable(self, raised):
        """Why no worker can be started."""
        import pdk_perturb as pdk

        return _program.error(
            "configuration",
            f"no worker could be started on the cluster, {TRIES} times in a row (the last: {reason(raised)}); install pdk-perturb "
            f"{pdk.__version__} on every machine",
        )

    def _give_all(self):
        """Gives what waits in all groups: an actor that has become free may make room for one of another group."""
        for name in self._groups:
            self._give(name)
        for hub in self._outgoing:
            hub.given += len(hub.outgoing)
            hub.give.remote(hub.outgoing)
            hub.outgoing = []
        self._outgoing.clear()

    def _check(self, ready):
        """Makes sure that a worker is of the same version and has the same components."""
        import pdk_perturb as pdk

        if ready["pdk"] != pdk.__version__:
            raise _program.error(
                "configuration",
                f"a machine of the cluster has pdk {ready['pdk']}, and this one {pdk.__version__}; install the same one everywhere",
            )

        def named(catalog):
            return {(e["description"]["kind"], e["description"]["name"], e["description"]["version"]) for e in catalog}

        missing = sorted(named(self._catalog) - named(ready["catalog"]))
        if missing:
            kind, name, version = missing[0]
            raise _program.error(
                "configuration", f"a machine of the cluster lacks the {kind} `{name}` (version {version}), which is there on this one"
            )

    def _answered(self, hub, answers):
        """Passes on what workers have said, and gives them more to do."""
        lines, traces = [], []
        for number, kind, said, trace in answers:
            actor = hub.actors[number]
            job, actor.job = actor.job, None
            if kind == "failed":
                self._fail(said)
            elif kind == "lost":
                self._lose(actor)
                self._again(actor.group, job, said)
            else:
                if kind == "broken":
                    # The session gives one slot less to do, so no other actor takes its number.
                    self._end(actor)
                else:
                    self._groups[actor.group].idle.append(actor)
                if trace is None:
                    lines.append(said)
                else:
                    traces.append((job, said, trace))
        if lines:
            self._say("\n".join(lines))
        if traces:
            self._run(self._keep(traces))
        self._give_all()

    async def _keep(self, traces):
        """Writes traces, and then says what came with them."""
        loop = asyncio.get_running_loop()
        await asyncio.gather(*(loop.run_in_executor(self._writers, _keep, job.line, trace) for job, _, trace in traces))
        self._say("\n".join(said for _, said, _ in traces))

    def _again(self, name, job, why):
        """Gives a job to another actor after one was lost over it, if that was not often the case."""
        if job.tries < TRIES:
            self._groups[name].waiting.appendleft(job)
            return
        answer = given_up(f"a worker of the cluster was lost {TRIES} times over it (the last: {why})")
        self._say(json.dumps({"done": {"number": json.loads(job.line)["job"]["number"], "answer": answer}}))

    def _lose(self, actor):
        heapq.heappush(self._numbers, actor.number)
        self._end(actor)

    def _end(self, actor):
        self._actors.discard(actor)
        if actor.hub is not None:
            actor.hub.actors.pop(actor.number, None)
        self._ray.kill(actor.handle)

    def _lose_hub(self, hub, why):
        """Gives the jobs of a relay to others. Its actors are gone too, most likely, and those that are not cannot tell what came of their jobs."""
        self._forget(hub)
        for group in self._groups.values():
            group.idle = [actor for actor in group.idle if actor.hub is not hub]
        # The ones that were given away first come first again.
        actors = sorted(hub.actors.values(), key=lambda actor: actor.job.given if actor.job else 0, reverse=True)
        for actor in actors:
            self._lose(actor)
            if actor.job is not None:
                self._again(actor.group, actor.job, why)
        self._ray.kill(hub.handle)
        self._give_all()

    def end(self):
        """Lets all actors go. What belongs to this program ends with it anyway, but not at once."""
        for task in self._listening:
            task.cancel()
        for actor in list(self._actors):
            self._lose(actor)
        for hub in set(self._hubs.values()):
            self._ray.kill(hub.handle)


def _keep(line, trace):
    """Writes the trace of a job as a worker does: complete, or not at all."""
    path = Path(json.loads(line)["job"]["work"]["drive"]["trace"])
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    with part.open("wb") as file:
        file.write(trace)
        file.flush()
        os.fsync(file.fileno())
    os.rename(part, path)


async def serve(chosen, say):
    """Relays between the session, at standard input, and the cluster."""
    import ray

    hello = sys.stdin.buffer.readline()
    if not hello:
        return
    answer = introduced(hello)
    if "ready" not in answer:
        say(json.dumps(answer))
        return
    connect(ray, chosen, say)
    with Head(ray.nodes, say, f"the head of the cluster at {ray.get_runtime_context().gcs_address}", patience()):
        await relay(hello, answer, chosen, say)


async def relay(hello, answer, chosen, say):
    """Relays between the session and the cluster, to which the connection is there."""
    import ray

    slots = chosen.slots or max(1, int(ray.cluster_resources().get("CPU", 1) // max(chosen.cpus, 0.001)))
    pool = Pool(hello, answer["ready"], chosen, slots, say)
    answer["ready"]["slots"] = slots
    say(json.dumps(answer))
    lines, loop = asyncio.Queue(), asyncio.get_running_loop()

    def listen():
        # All lines that are there at the same time are taken together.
        parts = []
        while chunk := sys.stdin.buffer.read1(1 << 20):
            parts.append(chunk)
            if b"\n" in chunk:
                *complete, rest = b"".join(parts).split(b"\n")
                parts = [rest]
                loop.call_soon_threadsafe(lines.put_nowait, [line for line in complete if line.strip()])
                time.sleep(pool.pause())
        loop.call_soon_threadsafe(lines.put_nowait, None)

    threading.Thread(target=listen, daemon=True).start()
    while (some := await lines.get()) is not None:
        try:
            pool.take(some)
        except Error as raised:
            pool.fail(raised)
    pool.end()


def main(words):
    chosen = options(words)
    try:
        import ray
    except ImportError:
        sys.exit("pdk: error: --pool ray needs the package ray; install it with `pip install 'pdk-perturb[ray]'`")
    # What others print is not for the session.
    output, writing = os.dup(1), threading.Lock()
    os.dup2(2, 1)

    def say(text):
        # A signal may end a write early, and another thread may have something to say.
        with writing:
            rest = memoryview(text.encode() + b"\n")
            while rest:
                rest = rest[os.write(output, rest) :]

    try:
        asyncio.run(serve(chosen, say))
    finally:
        ray.shutdown()


if __name__ == "__main__":
    main(sys.argv[1:])
