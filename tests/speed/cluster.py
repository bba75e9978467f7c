"""What a cluster costs: three nodes of Ray on this machine, against this machine alone.

    venv/bin/pip install target/pdk-dist/pdk_perturb-*.whl 'ray>=2.9'
    venv/bin/python tests/speed/cluster.py              # or some of: overhead, speedup, search, pool

Prints, as Markdown: the overhead of a scenario, the processor time of the pool for each, how the speed grows with the workers up to as many as
there are processors, and a search of five generations; both with a comparison of the ledgers.

`pool` measures the pool alone, with thousands of slots that are simulated: the relays answer each scenario after half of a mean time to one and
a half of it. The session is simulated too: it gives a slot the next scenario as soon as it has the answer to the last one.
"""

import asyncio
import collections
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from types import SimpleNamespace

os.environ["RAY_AUTH_MODE"] = "disabled"
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

import ray
from ray.cluster_utils import Cluster

import pdk_perturb as pdk
from pdk_perturb import ray as pool
from pdk_perturb._ray_worker import Relay

SHARED = {"simulator": {"name": "lane", "width": 64, "height": 48}, "driver": "lane_keeper", "images_every": 0}


def pool_seconds():
    """The processor time of the pool that runs now, in seconds."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if b"-m\0pdk_perturb.ray\0" in (process / "cmdline").read_bytes():
                fields = (process / "stat").read_text().rsplit(")", 1)[1].split()
                return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        except OSError:
            pass
    return 0.0


def drives(count, out, **more):
    """Seconds of wall time for this many short scenarios, once everything has been started, and of the pool's processor time."""
    with pdk.Session(**SHARED, duration=0.05, out=out, **more) as session:
        session.drive([{"repeat": 1_000_000 + number} for number in range(2 * session.slots)])
        began, pool = time.monotonic(), pool_seconds()
        session.drive([{"repeat": number} for number in range(count)])
        return time.monotonic() - began, pool_seconds() - pool


def lines(folder):
    return sorted((folder / "scenarios.jsonl").read_text().splitlines())


def overhead(pool, folder):
    count = 200
    print(f"{count} scenarios of two frames, two workers, load {os.getloadavg()[0]:.1f}:\n")
    print("| workers from | ms a scenario | pool, ms of processor time |\n|---|---:|---:|")
    for name, more in (("this machine", {"workers": 2}), ("Ray", {"pool": pool}), ("Ray, `--shared`", {"pool": pool + " --shared"})):
        wall, cpu = drives(count, folder / name.replace(" ", ""), **more)
        print(f"| {name} | {1000 * wall / count:.1f} | {1000 * cpu / count:.1f} |", flush=True)


def speedup(address, folder):
    processors = os.cpu_count()
    counts = [2**n for n in range(processors.bit_length()) if 2**n <= processors]
    scenarios = [
        {"road": {"angles": [0, n % 9, -(n % 9)], "segment": 25}, "perturbations": ["gaussian_noise@2"], "repeat": n}
        for n in range(12 * counts[-1])
    ]
    print("\n| workers | this machine | Ray |\n|---:|---:|---:|")
    same = []
    for count in counts:
        rates = []
        for name, more in (("here", {"workers": count}), ("ray", {"pool": f"ray --slots {count} --address {address}"})):
            out = folder / f"speedup-{name}-{count}"
            with pdk.Session(simulator="lane", driver="dave2", duration=10, seed=1, out=out, **more) as session:
                session.drive(scenarios[: 12 * count])
            rates.append(session.record.performance["drive"]["frames_per_second"])
        same.append(lines(folder / f"speedup-here-{count}") == lines(folder / f"speedup-ray-{count}"))
        print(f"| {count} | {rates[0]:,.0f} | {rates[1]:,.0f} |", flush=True)
    print(f"\nledgers equal as sets: {all(same)}")


def search(pool, folder):
    settings = {
        "strategy": {"name": "nsga2_dt", "population": 12},
        "evaluations": 60,
        "duration": 4,
        "perturbations": ["contrast", "fog_filter", "gaussian_noise", "translate_image"],
    }
    times = {}
    for name, more in (("here", {"workers": 2}), ("ray", {"pool": pool})):
        began = time.monotonic()
        pdk.run("search", settings, out=folder / f"search-{name}", seed=1, **more)
        times[name] = time.monotonic() - began
    same = lines(folder / "search-here") == lines(folder / "search-ray")
    tables = [(folder / f"search-{name}/search.csv").read_bytes() for name in times]
    print(f"\nfive generations of 12: here {times['here']:.1f} s, on Ray {times['ray']:.1f} s; ledgers equal as sets: {same}")
    print(f"tables of the search equal: {tables[0] == tables[1]}")


OUTCOME = {
    "success": False,
    "cause": "time_out",
    "time": 0.05,
    "frames": 2,
    "progress": 0.001849516759950795,
    "mean_cross_track_error": 5.35904279107121e-6,
    "max_cross_track_error": 0.000010718085582140875,
    "digest": "b8578b499fdbef5ec96d3766d724d423",
}
COUNTS = [[[653, 1], [659, 1]], [[572, 1], [578, 1]], [[492, 1], [494, 1]], [[495, 1], [538, 1]]]
DRIVEN = json.dumps({"driven": {"outcome": OUTCOME, "rate": 20.0, "times": {"steps": 2, "overruns": 0, "counts": COUNTS}}})
MADE = {"simulator": {"camera": {"width": 320, "height": 160, "rate": 20.0}}}
NUMBER = re.compile(rb'"number": ?([0-9]+)')


class Simulated(Relay):
    """A relay whose workers are simulated: a scenario takes half of `mean` seconds to one and a half."""

    def __init__(self, mean):
        super().__init__()
        self._mean = mean

    async def _work(self, slot, line, files, blobs):
        number = int(NUMBER.search(line)[1])
        if b'"make"' in line:
            made = MADE.get(json.loads(line)["job"]["work"]["make"]["kind"], {})
            return slot, "done", json.dumps({"done": {"number": number, "answer": {"made": made}}}), None
        if self._mean:
            await asyncio.sleep(self._mean * (0.5 + number * 7919 % 1000 / 1000))
        progress = f'{{"progress":{{"number":{number},"frames":2}}}}'
        return slot, "done", f'{progress}\n{{"done":{{"number":{number},"answer":{DRIVEN}}}}}', None


def simulate(slots, mean, machines):
    """The pool for Ray with this many simulated slots on this many machines, each with a relay: `--pool "python cluster.py simulate ..."`."""
    remote, kill = ray.remote, ray.kill
    started = []

    def worker(*_):
        node = f"{len(started) % machines:056x}"
        started.append(node)

        async def start(blobs):
            return "the same", node

        async def said():
            return json.dumps({"ready": {"pdk": pdk.__version__, "catalog": []}})

        return SimpleNamespace(start=SimpleNamespace(remote=start), said=SimpleNamespace(remote=said))

    def replaced(*given, **more):
        made = {pool.Worker: worker, pool.Relay: lambda: remote(Simulated).options(num_cpus=0).remote(mean)}.get(*given[:1]) if given else None
        return remote(*given, **more) if made is None else SimpleNamespace(options=lambda **_: SimpleNamespace(remote=made))

    class Actor(pool.Actor):
        """One whose handle stays here."""

        def __init__(self, *given):
            super().__init__(*given)
            self.is_known = True

    ray.remote, pool.Actor = replaced, Actor
    ray.kill = lambda handle: None if isinstance(handle, SimpleNamespace) else kill(handle)
    pool.Pool._check = lambda *_: None
    pool.main(["--shared", "--slots", str(slots), "--address", "local"])


def processor_seconds(own):
    """Seconds of processor time of the pool and of all processes of Ray so far."""
    spent = collections.Counter()
    for process in Path("/proc").glob("[0-9]*"):
        try:
            command = (process / "cmdline").read_bytes()
            fields = (process / "stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        who = "pool" if int(process.name) == own else "relays" if command.startswith(b"ray::Simulated") else None
        spent[who] += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return spent


def feed(slots, mean, machines, count):
    """Gives scenarios to a pool. Returns how many it serves in a second, how many milliseconds of processor time each takes of the pool and of the relays,
    and how long each took beyond its own time: the median and 95 % in milliseconds."""
    command = [sys.executable, __file__, "simulate", str(slots), str(mean), str(machines)]
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    search = {"plugins": [], "drop_ins": []}
    hello = {"protocol": 2, "minor": 2, "run": "speed", "patience": 60.0, "memory": 4096, "search": search}
    child.stdin.write(json.dumps({"hello": hello}).encode() + b"\n")
    child.stdin.flush()
    assert b'"ready"' in child.stdout.readline()
    scenario = {
        "simulator": {"name": "lane"},
        "driver": {"name": "lane_keeper"},
        "road": {"angles": [0, 1, 10, -20, 15, 0, 5, 0], "segment": 25},
        "perturbations": [{"name": "gaussian_noise", "level": 1.0}],
        "duration": 0.05,
        "seed": 1599288913520833,
    }
    work = {"drive": {"scenario": scenario, "name": "gaussian_noise@1", "trace": "/runs/speed/traces/1.mcap", "images_every": 0}}
    after = f',"slot":0,"work":{json.dumps(work)}}}}}\n'
    warm = 2 * slots + 1000
    sent, longer = {}, []

    def send(numbers):
        now = time.monotonic()
        sent.update((number, now) for number in numbers)
        child.stdin.write("".join(f'{{"job":{{"number":{number}{after}' for number in numbers).encode())
        child.stdin.flush()

    def answers():
        rest = b""
        while chunk := child.stdout.read1(1 << 20):
            *lines, rest = (rest + chunk).split(b"\n")
            now = time.monotonic()
            numbers = [int(NUMBER.search(line)[1]) for line in lines if line.startswith(b'{"done"')]
            longer.extend(now - sent.pop(number) - mean * (0.5 + number * 7919 % 1000 / 1000) for number in numbers)
            yield len(numbers)

    threading.Thread(target=send, args=[range(slots)]).start()
    given, done, began = slots, 0, None
    for some in answers():
        done += some
        if began is None and done >= warm:
            began, before, spent = time.monotonic(), done, processor_seconds(child.pid)
            longer.clear()
        if given >= warm + count + slots:
            break
        send(range(given, given + some))
        given += some
    seconds, served, now = time.monotonic() - began, done - before, processor_seconds(child.pid)
    child.stdin.close()
    child.stdout.close()
    child.wait()
    longer.sort()
    each = [1000 * (now[who] - spent[who]) / served for who in ("pool", "relays")]
    return served / seconds, *each, 1000 * longer[len(longer) // 2], 1000 * longer[len(longer) * 95 // 100]


def alone():
    print(f"\nthe pool alone, load {os.getloadavg()[0]:.1f}:\n")
    print("| slots | relays | mean time, s | scenarios a second | pool, ms of processor time | relays, ms | waits, ms: median | 95 % |")
    print("|---:|---:|---:|---:|---:|---:|---:|---:|")
    short = [(1, 1, 0, 500), (500, 3, 0, 60_000)]
    for slots, machines, mean, count in short + [(n, m, 1, 6 * n) for n, m in ((500, 3), (1000, 3), (3000, 3), (4000, 3), (4000, 8))]:
        rate, own, relays, median, most = feed(slots, mean, machines, count)
        print(f"| {slots:,} | {machines} | {mean} | {rate:,.0f} | {own:.2f} | {relays:.2f} | {median:.0f} | {most:.0f} |", flush=True)


def main(parts):
    if parts[:1] == ["simulate"]:
        slots, mean, machines = parts[1:]
        return simulate(int(slots), float(mean), int(machines))
    if parts == ["pool"]:
        return alone()
    processors = -(-os.cpu_count() // 3)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": processors})
    cluster.add_node(num_cpus=processors)
    cluster.add_node(num_cpus=processors)
    cluster.wait_for_nodes()
    words = f"ray --slots 2 --address {cluster.address}"
    runs = {
        "overhead": lambda folder: overhead(words, folder),
        "speedup": lambda folder: speedup(cluster.address, folder),
        "search": lambda folder: search(words, folder),
        "pool": lambda folder: alone(),
    }
    with tempfile.TemporaryDirectory() as folder:
        for part in parts or runs:
            runs[part](Path(folder))
    cluster.shutdown()


if __name__ == "__main__":
    main(sys.argv[1:])
