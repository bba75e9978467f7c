"""python3 mce.py PDK DATA SUMMARY: the corruption errors of a small classifier, computed without pdk but for the perturbed pictures.

The classifier calls a picture red, green or blue by the largest mean of its channels. DATA has a folder of pictures for each class,
SUMMARY is the summary.json of `pdk.evaluate` with the seed 0 and the baseline below. Prints both results, and exits with 1 if they
differ. The formulas are those of D. Hendrycks and T. Dietterich (2019), section 4.1. Needs numpy and Pillow.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
from PIL import Image

CLASSES = ["blue", "green", "red"]
CHANNELS = [2, 1, 0]
BASELINE = {"clean": 0.1, "errors": {"gaussian_noise": 0.5, "impulse_noise": 0.4}}
LEVELS = [0, 1, 2, 3, 4]


def called(path):
    """The class that the classifier gives to a picture."""
    pixels = numpy.asarray(Image.open(path).convert("RGB"), dtype=numpy.float64) / 255
    return int(numpy.argmax([pixels[..., channel].mean() for channel in CHANNELS]))


def perturbed(pdk, picture, place, perturbation, level, folder):
    """A file with a picture under a perturbation, as an evaluation has it."""
    out = Path(folder) / "out.png"
    command = [pdk, "perturb", picture, "-o", out, "--with", f"{perturbation}@{level}", "--seed", "0"]
    subprocess.run([*command, "--frame", str(place), "--time", str(place / 20)], check=True, capture_output=True)
    return out


def main(pdk, data, summary):
    pictures = sorted(Path(data).glob("*/*.png"), key=lambda path: (path.parent.name, path.name))
    truth = [CLASSES.index(path.parent.name) for path in pictures]

    def error(paths):
        return sum(called(path) != label for path, label in zip(paths, truth)) / len(truth)

    clean = error(pictures)
    ces, relative = [], []
    with tempfile.TemporaryDirectory() as folder:
        for perturbation, baseline in BASELINE["errors"].items():
            errors = [
                error(perturbed(pdk, path, place, perturbation, level, folder) for place, path in enumerate(pictures))
                for level in LEVELS
            ]
            ces.append(sum(errors) / (len(LEVELS) * baseline))
            relative.append(sum(e - clean for e in errors) / (len(LEVELS) * (baseline - BASELINE["clean"])))
    plain = {"clean": clean, "mce": sum(ces) / len(ces), "relative_mce": sum(relative) / len(relative)}
    evaluation = json.loads(Path(summary).read_text())["evaluations"][0]
    told = evaluation["corruption_errors"]
    by_pdk = {
        "clean": evaluation["original"][0]["value"],
        "mce": told["mce"],
        "relative_mce": told["relative_mce"],
    }
    print("plain", plain)
    print("pdk  ", by_pdk)
    return 0 if all(abs(plain[name] - by_pdk[name]) < 1e-12 for name in plain) else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
