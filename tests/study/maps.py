"""How faithful saliency methods and layers are on frames of `lane`: the table of docs/saliency.md behind the default layer.

    python3 tests/study/maps.py --pdk target/release/pdk

Of each method, by how much its maps are better than themselves in other places, by four measures: the mean of the means in easy, standard and hard
conditions. The intervals (95 %) are those of the three, as if they were independent. Takes about 40 minutes. What `pdk saliency` measured is kept in
the folder, so a second call goes on from where the first one ended.
"""

import argparse
import json
import math
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
NETWORKS = ["dave2", "dave2_augmented", "dave2_tub", "dave2_hardened"]
CONDITIONS = ["easy", "standard", "hard"]
LAYER = "hirescam,layer=/convolutions/convolutions.{}/Conv"
# The first is the default, with which the others are compared.
METHODS = {
    "hirescam": "**`hirescam`, 22 x 5**",
    LAYER.format(8): "`hirescam`, 18 x 1 cells",
    LAYER.format(6): "`hirescam`, 20 x 3",
    LAYER.format(2): "`hirescam`, 47 x 14",
    LAYER.format(0): "`hirescam`, 98 x 31",
    "gradient": "`gradient`",
    "smooth-grad": "`smooth-grad`",
    "integrated-gradients": "`integrated-gradients`",
    "occlusion": "`occlusion`",
}
FRAMES = 31
MEASURES = ["deletion", "insertion", "sensitivity", "infidelity"]


def measured(pdk, folder, network, conditions):
    """What `pdk saliency` measures of all methods."""
    path = folder / f"{network}-{conditions}.json"
    if not path.exists():
        frames = folder / conditions
        if not (frames / "summary.json").exists():
            command = [pdk, "run", HERE / "maps.lua", "--set", f"conditions={conditions}", "--out", frames]
            subprocess.run(command, check=True, capture_output=True)
        methods = [word for method in METHODS for word in ("--with", method)]
        command = [pdk, "saliency", frames, "--driver", network, "--count", str(FRAMES), "--curves", "--json", "-o", folder / "maps", *methods]
        path.write_text(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return json.loads(path.read_text())["curves"]


def together(estimates):
    """The mean of some means with their intervals."""
    mean = sum(of["value"] for of in estimates) / len(estimates)
    below, above = (math.hypot(*(of[end] - of["value"] for of in estimates)) / len(estimates) for end in ("low", "high"))
    return f"{mean:+.3f} ({mean - below:+.3f} to {mean + above:+.3f})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pdk", default="pdk")
    parser.add_argument("--out", type=Path, default=Path("maps"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    print("| network | map | deletion | insertion | sensitivity-n | infidelity | against the default |\n|---|---|---|---|---|---|---|")
    for network in NETWORKS:
        curves = [measured(arguments.pdk, arguments.out, network, conditions) for conditions in CONDITIONS]
        for number, name in enumerate(METHODS.values()):
            of = [by_method[number] for by_method in curves]
            cells = [together([found[measure]["better_than_moved"] for found in of]) for measure in MEASURES]
            cells.append("" if number == 0 else together([found["deletion_less_insertion_against_first"] for found in of]))
            print("| " + " | ".join([f"`{network}`" if number == 0 else "", name, *cells]) + " |")


if __name__ == "__main__":
    main()
