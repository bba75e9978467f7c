"""Writes what follows from the record of a study: the tables of docs/breaks.md, scripts/ranking.json, and from that the order of the
perturbations in scripts/search.lua; and prints what the text of docs/breaks.md says of it.

    pdk run study --out record
    python -m venv venv && venv/bin/pip install -r tests/study/requirements.txt
    venv/bin/python tests/study/breaks.py record --pdk target/release/pdk            # prints only
    venv/bin/python tests/study/breaks.py record --pdk target/release/pdk --write

How alike a frame and its perturbed copy are is measured on three frames of a drive in each of the conditions, perturbed at level 4
by pdk itself.
"""

import argparse
import io
import json
import re
import subprocess
import tempfile
import textwrap
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from PIL import Image
from scipy.stats import spearmanr
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/breaks.md"
SEARCH = ROOT / "scripts/search.lua"
LINE = 124  # columns of a line of Lua, of which a tab takes four
HIGHEST = 4


def percent(share):
    """A share as tables have it."""
    return "< 1 %" if 0 < share < 0.005 else f"{100 * share:.0f} %"


# ---------------------------------------------------------------------------------------------------------------------
# Tables


def told(found):
    """The level from which on a driver fails, as tables have it."""
    return f"{found['level']:.1f}" if found and found.get("level") is not None else "–"


def ranking_table(ranking):
    """The perturbations that break anything, and the others by name."""
    drivers = [f"`{driver}`" for driver in ranking["drivers"]]
    header = ["group", "perturbation", "levels that fail", "95 %", "stopped, late", "over the line", *drivers, *ranking["conditions"]]
    lines = [row(header), "|---" * len(header) + "|"]
    none = []
    for entry in ranking["ranking"]:
        if entry["failures"] == 0:
            none.append(f"`{entry['perturbation']}`")
            continue
        low, high = (f"{100 * entry[f'failed_share_{end}']:.0f}" for end in ("low", "high"))
        cells = [entry["group"], f"`{entry['perturbation']}`", percent(entry["failed_share"]), f"{low} to {high} %"]
        cells.append(f"{entry['stopped']}, {entry['late']} of {entry['failures']}")
        cells.append(percent(entry["over_line"] / max(entry["drives"] - entry["failures"], 1)))
        cells += [told(of["failing_level"]) for of in entry["by_driver"]]
        cells += [told(of["failing_level"]) for of in entry["by_conditions"]]
        lines.append(row(cells))
    most = max(entry["failed_share_high"] for entry in ranking["ranking"] if entry["failures"] == 0)
    roads = ranking["roads"]
    return "\n".join(lines) + f"\n\nNothing failed with {', '.join(none)}. With {roads} roads, a share of up to {percent(most)} is possible.\n"


def level_table(ranking):
    """The share of perturbations and roads that fail at each level."""
    levels = ranking["levels"]
    header = ["conditions", "driver", f"level {levels[0]}", *levels[1:], "between 0 and 1"]
    lines = [row(header), "|---" * len(header) + "|"]
    for of in ranking["by_level"]:
        shares = [percent(level["failed_share"]) for level in of["by_level"]]
        lines.append(row([of["conditions"], f"`{of['driver']}`", *shares, percent(of["between"])]))
    return "\n".join(lines) + "\n"


def in_order(script, ranking):
    """The script of the search with its perturbations from the weakest to the strongest."""
    head, rest = script.split("\tperturbations = {\n")
    listed, rest = rest.split("\n\t},\n", 1)
    listed = set(re.findall(r'"(\w+)"', listed))
    names = [f'"{entry["perturbation"]}",' for entry in reversed(ranking["ranking"]) if entry["perturbation"] in listed]
    assert len(names) == len(listed), listed
    lines = textwrap.wrap(" ".join(names), LINE - 8)
    return head + "\tperturbations = {\n" + "\n".join(f"\t\t{line}" for line in lines) + "\n\t},\n" + rest


def made(record):
    """What the study was made with: all that it takes to compute it again."""
    manifest = json.loads((record / "manifest.json").read_text())
    engines = set()
    for line in (record / "scenarios.jsonl").open():
        driver = json.loads(line)["scenario"]["driver"]
        engines.add(driver.get("parameters", {}).get("engine", "no network"))
    versions = {component["name"]: component["version"] for component in manifest["components"]}
    fields = {key: manifest[key] for key in ("pdk", "seed", "settings", "machine")}
    return {**fields, "engines": sorted(engines), "components": versions}


def rounded(value):
    """A value with four decimals in each of its numbers but the shares by road, from which groups are computed, and what it was made with."""
    if isinstance(value, dict):
        return {key: of if key in ("shares", "made") else rounded(of) for key, of in value.items()}
    if isinstance(value, list):
        return [rounded(of) for of in value]
    return round(value, 4) if isinstance(value, float) else value


def in_short(ranking):
    """The ranking as JSON that can be compared line by line."""
    written = lambda value: json.dumps(value, separators=(",", ":"), sort_keys=True)  # noqa: E731
    listed = lambda values: "[\n" + ",\n".join(map(written, values)) + "\n]"  # noqa: E731
    fields = sorted(rounded(ranking).items())
    return "{\n" + ",\n".join(f'"{key}": {listed(of) if isinstance(of, list) else written(of)}' for key, of in fields) + "\n}\n"


def row(cells):
    return "| " + " | ".join(map(str, cells)) + " |"


def between(text, what, table):
    """The text with another table between the marks of `what`."""
    start, end = f"<!-- {what} -->\n", f"<!-- end of {what} -->"
    head, rest = text.split(start)
    return f"{head}{start}{table}{end}{rest.split(end)[1]}"


# ---------------------------------------------------------------------------------------------------------------------
# What the text says


def cells_between(ranking):
    """How many cells, a perturbation at a level, are neither 0 nor 1; of all, and of the perturbations that break anything."""
    shares = defaultdict(list)
    for entry in ranking["ranking"]:
        for cell in entry["cells"]:
            shares[entry["failures"] > 0] += [level["failed_share"] for level in cell["by_level"]]
    inside = {breaks: sum(0 < share < 1 for share in of) for breaks, of in shares.items()}
    count, breaking = sum(map(len, shares.values())), len(shares[True])
    print(f"cells between 0 and 1: {sum(inside.values())} of {count}, {100 * sum(inside.values()) / count:.1f} %")
    print(f"of perturbations that break anything: {inside[True]} of {breaking}, {100 * inside[True] / breaking:.0f} %")


def drives(record):
    """How many there are, and how often two that differ only in their seed have different outcomes."""
    scenarios = [json.loads(line) for line in (record / "scenarios.jsonl").open()]
    frames = sum(scenario["frames"] for scenario in scenarios)
    causes = Counter(scenario["cause"] for scenario in scenarios)
    print(f"{len(scenarios):,} scenarios, {frames:,} frames, {sum(not s['success'] for s in scenarios):,} failed: {dict(causes)}")
    pairs, by_name = defaultdict(list), Counter()
    for scenario in scenarios:
        what = scenario["scenario"]
        name = scenario["name"].split(", repeat")[0]
        pairs[(what["simulator"]["parameters"]["conditions"], json.dumps(what["driver"]), name)].append(scenario["success"])
    # At the highest level all pairs were driven; lower ones only where both failed above.
    pairs = {key: of for key, of in pairs.items() if len(of) == 2 and not all(of) and f"@{HIGHEST}," in key[2]}
    for (_, _, name), of in pairs.items():
        by_name[name.split("@")[0]] += of[0] != of[1]
    print(f"pairs at level {HIGHEST} with a failure: {len(pairs)}, different: {sum(by_name.values())}: {by_name.most_common(6)}")
    passed = [s for s in scenarios if s["success"] and f"@{HIGHEST}," in s["name"]]
    over = sum(s["measures"]["over_line_seconds"] > 0 for s in passed)
    print(f"at level {HIGHEST} {len(passed)} drives came to the end, {over} with a wheel over the line")
    in_fog = defaultdict(Counter)
    for scenario in scenarios:
        name = scenario["name"].split("@")[0]
        in_fog[scenario["scenario"]["driver"]["name"]][name, scenario["success"]] += 1
    for driver, of in in_fog.items():
        told_of = ("fog_filter", "snow_filter", "frost_filter", "sharpen_filter", "grayscale_filter")
        print(driver, {name: f"{of[name, False]} of {of[name, False] + of[name, True]} failed" for name in told_of})
    return scenarios


FRAMES = """
pdk.drive({
	simulator = { name = "lane", conditions = "CONDITIONS" },
	driver = "dave2",
	duration = 20,
	images_every = 100,
	scenarios = { { name = "clear", road = pdk.road({ seed = 1, limit = 35, segment = 50, attempts = 1000 }).road } },
})
"""


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB"))


def likeness(pdk, ranking):
    """How far what a person sees says what breaks networks: rank correlations of measures of the picture with the ranking."""
    names = [entry["perturbation"] for entry in ranking["ranking"]]
    measures = defaultdict(lambda: defaultdict(list))
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        frames = []
        for conditions in ranking["conditions"]:
            script, record = folder / f"{conditions}.lua", folder / conditions
            script.write_text(FRAMES.replace("CONDITIONS", conditions))
            subprocess.run([pdk, "run", script, "--out", record], check=True, capture_output=True)
            (trace,) = record.glob("traces/*.mcap")
            with trace.open("rb") as file:
                messages = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages("/raw")
                images = [decoded.data for _, _, _, decoded in messages]
            for number, image in enumerate(images[1:4]):
                frames.append(folder / f"{conditions}-{number}.png")
                Image.open(io.BytesIO(image)).save(frames[-1])
        assert len(frames) == 3 * len(ranking["conditions"]), frames
        for frame in frames:
            original = pixels(frame)
            for name in names:
                out = folder / "out.png"
                subprocess.run([pdk, "perturb", frame, "--with", f"{name}@{HIGHEST}", "--time", "1", "-o", out], check=True, capture_output=True)
                perturbed = pixels(out)
                of = measures[name]
                of["SSIM"].append(structural_similarity(original, perturbed, channel_axis=2))
                of["PSNR"].append(peak_signal_noise_ratio(original, perturbed) if (original != perturbed).any() else 99.0)
                of["brightness"].append(abs(perturbed.mean() - original.mean()))
    shares = [entry["failed_share"] for entry in ranking["ranking"]]
    for measure in ("SSIM", "PSNR", "brightness"):
        values = [np.mean(measures[name][measure]) for name in names]
        print(f"{measure}: rho {spearmanr(values, shares).statistic:.2f}")
    for name in names:
        print(f"  {name}: " + ", ".join(f"{measure} {np.mean(values):.2f}" for measure, values in measures[name].items()))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("record", type=Path, help="the folder of the record of a study")
    parser.add_argument("--pdk", default="pdk", help="the program that perturbs frames")
    parser.add_argument("--write", action="store_true", help="write the files")
    options = parser.parse_args()
    ranking = json.loads((options.record / "ranking.json").read_text())
    ranking["made"] = made(options.record)
    tables = {"ranking": ranking_table(ranking), "levels": level_table(ranking)}
    print("\n".join(tables.values()))
    drives(options.record)
    cells_between(ranking)
    for compared in ranking["comparisons"]:
        print(compared["against"], compared["paired"])
    for of in ranking["nominal"]:
        print("nominal", of["conditions"], of["driver"], len(of["roads"]), "roads, over the line on", sum(road["over_line"] for road in of["roads"]))
    likeness(options.pdk, ranking)
    if options.write:
        page = PAGE.read_text()
        for what, table in tables.items():
            page = between(page, what, table)
        PAGE.write_text(page)
        (ROOT / "scripts/ranking.json").write_text(in_short(ranking))
        SEARCH.write_text(in_order(SEARCH.read_text(), ranking))


if __name__ == "__main__":
    main()
