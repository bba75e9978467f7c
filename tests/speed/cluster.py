"""What a cluster costs: three nodes of Ray on this machine, against this machine alone.

    venv/bin/pip install target/pdk-dist/pdk_perturb-*.whl 'ray>=2.9'
    venv/bin/python tests/speed/cluster.py              # or one of: overhead, speedup, search

Prints, as Markdown: the overhead of a scenario, the processor time of the pool for each, how the speed grows with the workers up to as many as
there are processors, and a search of five generations; both with a comparison of the ledgers.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

os.environ["RAY_AUTH_MODE"] = "disabled"
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

from ray.cluster_utils import Cluster

import pdk_perturb as pdk

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


def main(parts):
    processors = -(-os.cpu_count() // 3)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": processors})
    cluster.add_node(num_cpus=processors)
    cluster.add_node(num_cpus=processors)
    cluster.wait_for_nodes()
    pool = f"ray --slots 2 --address {cluster.address}"
    runs = {
        "overhead": lambda folder: overhead(pool, folder),
        "speedup": lambda folder: speedup(cluster.address, folder),
        "search": lambda folder: search(pool, folder),
    }
    with tempfile.TemporaryDirectory() as folder:
        for part in parts or runs:
            runs[part](Path(folder))
    cluster.shutdown()


if __name__ == "__main__":
    main(sys.argv[1:])
