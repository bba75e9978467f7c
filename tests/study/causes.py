"""How well saliency methods find what is proven to make a drive fail: a table of docs/saliency.md.

    pdk run tests/study/causes.lua --out failures
    python -m venv venv && venv/bin/pip install -r tests/study/requirements.txt
    venv/bin/python tests/study/causes.py failures --pdk target/release/pdk --out causes

Of each network's failures on each road, one is explained by `pdk why`. It proves two parts of the drive, each with a box: changed there alone, the drive
fails; with everything but that changed, it passes. Maps are made of frames in these parts, as the camera saw them in the drives that prove them. A map is
scored by the probability that a pixel in the box has a larger value than one outside (the area under the ROC curve, AUC).

Networks look at the road, and boxes lie on the road, so a score says little by itself. Two controls tell what a map knows of its frame: the score
of the same method's maps for the same network on other roads, with this box; and that of a map that is always the same, the mean of the boxes
of the other roads. Intervals are by road.

`pdk why` moves the sides of a box inwards in a fixed order, so another box may be as good. Causes that take the whole frame are left out, and counted.
Causes and maps are kept in the folder, so a second call goes on from where the first one ended.
"""

import argparse
import io
import json
import shutil
import subprocess
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from PIL import Image
from scipy.stats import rankdata

METHODS = [
    "hirescam",
    "gradient",
    "smooth-grad",
    "integrated-gradients",
    "grad-cam",
    "score-cam",
    "occlusion",
    "rise",
]
DRAWS = 10_000


def chosen(record):
    """A failure of each network on each road, with perturbations in turns: the number of the scenario and the road's."""
    cells, roads, drivers = defaultdict(list), [], []
    for number, line in enumerate((record / "scenarios.jsonl").read_text().splitlines()):
        line = json.loads(line)
        scenario = line["scenario"]
        road, driver = json.dumps(scenario["road"]), scenario["driver"]["name"]
        for known, value in [(roads, road), (drivers, driver)]:
            if value not in known:
                known.append(value)
        if line["cause"] == "lane_departure":
            cells[roads.index(road), drivers.index(driver)].append((number, driver))
    for (road, turn), failures in sorted(cells.items()):
        number, driver = failures[(road + turn) % len(failures)]
        yield number, road, driver


def explain(pdk, record, number, folder):
    """What `pdk why` says of a scenario, or why it says nothing."""
    path = folder / "why.json"
    if not path.exists():
        ran = subprocess.run([pdk, "why", record, "--scenario", str(number), "--json", "-o", folder], capture_output=True, text=True)
        if ran.returncode != 0:
            return {"error": ran.stderr.strip()}
        path.write_text(ran.stdout)
    return json.loads(path.read_text())


def drive(pdk, folder, name):
    """The images and speeds of a drive that proves a part."""
    record = folder / f"{name}-record"
    if not record.exists():
        part = record.with_suffix(".part")
        shutil.rmtree(part, ignore_errors=True)
        subprocess.run([pdk, "run", folder / f"{name}.lua", "--out", part], check=True, capture_output=True)
        part.rename(record)
    (trace,) = record.glob("traces/*.mcap")
    images, speeds = [], []
    with trace.open("rb") as file:
        messages = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(["/raw", "/state"])
        for _, channel, _, message in messages:
            images.append(message.data) if channel.topic == "/raw" else speeds.append(message.speed)
    return images, speeds


def maps_of(pdk, folder, name, driver, frames):
    """For each of some frames of a drive, the map of each method in the size of the frame."""
    every = []
    for frame in frames:
        out = folder / f"{name}-{frame}"
        if not out.exists():
            images, speeds = drive(pdk, folder, name)
            part = out.with_suffix(".part")
            shutil.rmtree(part, ignore_errors=True)
            part.mkdir()
            Image.open(io.BytesIO(images[frame])).save(part / "frame.png")
            methods = [word for method in METHODS for word in ("--with", method)]
            command = [pdk, "saliency", part / "frame.png", "--driver", driver, "--speed", str(speeds[frame]), "--full", *methods, "-o", part]
            subprocess.run(command, check=True, capture_output=True)
            part.rename(out)
        maps = {method: np.load(out / f"frame.{method}.npy") for method in METHODS}
        every.append({method: rankdata(map).reshape(map.shape) for method, map in maps.items()})
    return every


def inside(box, shape):
    """The pixels whose centres lie in a box."""
    left, top, right, bottom = box
    (height, width) = shape
    x, y = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    return ((y >= top) & (y < bottom))[:, None] & ((x >= left) & (x < right))[None, :]


def auc(ranks, mask):
    """The probability that a value in the mask is larger than one outside; equal ones count half."""
    within, outside = mask.sum(), (~mask).sum()
    return (ranks[mask].sum() - within * (within + 1) / 2) / (within * outside)


def interval(values, roads, random):
    """The mean, and its 95 % interval by drawing roads with replacement."""
    groups = [np.array([value for value, of in zip(values, roads) if of == road]) for road in sorted(set(roads))]
    sums, counts = np.array([group.sum() for group in groups]), np.array([len(group) for group in groups])
    drawn = random.integers(len(groups), size=(DRAWS, len(groups)))
    means = sums[drawn].sum(1) / counts[drawn].sum(1)
    return np.mean(values), *np.percentile(means, [2.5, 97.5])


def spread(first, last):
    """Up to three frames of a span: its ends and its middle."""
    return sorted({first, (first + last) // 2, last})


def collect(arguments, part):
    """The causes: road, network, perturbation, box, and the ranks of the maps by method of each frame."""
    causes, left_out, probes = [], [], []
    for number, road, driver in chosen(arguments.record):
        folder = arguments.out / str(number)
        folder.mkdir(parents=True, exist_ok=True)
        why = explain(arguments.pdk, arguments.record, number, folder)
        if "error" in why:
            left_out.append((number, why["error"]))
            continue
        probes.append(why["probes"])
        found = why[part]
        if found["box"] is None:
            left_out.append((number, "all of the frame"))
            continue
        maps = maps_of(arguments.pdk, folder, part, driver, spread(*found["frames"]))
        perturbation = found["scenario"]["perturbations"][0]["name"]
        causes.append((road, driver, perturbation, found["box"], maps))
        print(f"{part}: {len(causes)} causes", end="\r", flush=True)
    return causes, left_out, probes


def table(causes):
    """Prints how well each method finds the boxes."""
    random = np.random.default_rng(0)
    roads = [road for road, *_ in causes]
    shape = causes[0][4][0][METHODS[0]].shape
    masks = [inside(box, shape) for *_, box, _ in causes]
    rows, scores = [], {}
    for method in METHODS:
        own, better = [], []
        for (road, driver, _, _, maps), mask in zip(causes, masks):
            own.append(np.mean([auc(of[method], mask) for of in maps]))
            others = [of[method] for other, of_driver, _, _, all in causes for of in all if other != road and of_driver == driver]
            better.append(own[-1] - np.mean([auc(ranks, mask) for ranks in others]))
        scores[method] = np.array(own)
        rows.append((f"`{method}`", interval(own, roads, random), interval(better, roads, random)))
    constant = []
    for (road, *_), mask in zip(causes, masks):
        mean = np.mean([other for other, (of, *_) in zip(masks, causes) if of != road], axis=0)
        constant.append(auc(rankdata(mean).reshape(shape), mask))
    rows.append(("always the same map: the mean of the boxes of other roads", interval(constant, roads, random), None))
    rows.sort(key=lambda row: -row[1][0])
    print("| map | AUC | better than the network's maps of other roads | better than always the same map |\n|---|---|---|---|")
    shown = lambda found: "" if found is None else f"{found[0]:+.3f} ({found[1]:+.3f} to {found[2]:+.3f})"
    for name, (mean, low, high), better in rows:
        method = name.strip("`")
        against = interval(scores[method] - np.array(constant), roads, random) if method in scores else None
        print(f"| {name} | {mean:.3f} ({low:.3f} to {high:.3f}) | {shown(better)} | {shown(against)} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("record", type=Path)
    parser.add_argument("--pdk", default="pdk")
    parser.add_argument("--out", type=Path, default=Path("causes"))
    arguments = parser.parse_args()
    for part in ("sufficient", "necessary"):
        causes, left_out, probes = collect(arguments, part)
        for number, reason in left_out:
            print(f"left out: scenario {number}: {reason}")
        shares = [(right - left) * (bottom - top) for *_, (left, top, right, bottom), _ in causes]
        print(f"{part}: {len(causes)} causes on {len({road for road, *_ in causes})} roads; the box is {100 * np.median(shares):.0f} % of the frame in the median")
        print(f"perturbations: {dict(Counter(perturbation for _, _, perturbation, _, _ in causes))}")
        print(f"drives for a cause: {np.median(probes):.0f} in the median, {min(probes)} to {max(probes)}")
        table(causes)


if __name__ == "__main__":
    main()
