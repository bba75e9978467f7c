"""python3 pixels.py PDK DATA LABELS SUMMARY: mIoU or depth errors of a small network, computed without pdk but for the perturbed pictures.

Segmentation: the network gives the picture, and the class of a pixel is its largest channel; LABELS has masks of half the size with the
values 0, 7 and 9 for the classes, and 255. Depth: the distance of a pixel is 1 + 4 red + 2 green + blue, with channels from 0 to 1;
LABELS has 16-bit PNG files in units of 1/256 m or arrays of numpy in units of 1/256. DATA has the pictures, SUMMARY is the
summary.json of `pdk.evaluate` with the seed 0. Prints both results, and exits with 1 if they differ by more than 1e-6. Needs numpy and
Pillow.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
from PIL import Image

VALUES = [0, 7, 9]
FARTHEST = 6.0


def pixels(path):
    return numpy.asarray(Image.open(path).convert("RGB"), dtype=numpy.float32) / numpy.float32(255)


def perturbed(pdk, picture, place, row, folder):
    """A file with a picture under a perturbation, as an evaluation has it."""
    out = Path(folder) / "out.png"
    command = [pdk, "perturb", picture, "-o", out, "--with", f"{row['label']}@{row['level']}", "--seed", "0"]
    subprocess.run([*command, "--frame", str(place), "--time", str(place / 20)], check=True, capture_output=True)
    return out


def segmentation(images, labels):
    matrix = numpy.zeros((3, 3), dtype=numpy.int64)
    right = count = 0
    for image, label in zip(images, labels):
        mask = numpy.asarray(Image.open(label))
        said = image.argmax(axis=2)
        rows = [(2 * y + 1) * said.shape[0] // (2 * mask.shape[0]) for y in range(mask.shape[0])]
        columns = [(2 * x + 1) * said.shape[1] // (2 * mask.shape[1]) for x in range(mask.shape[1])]
        said = said[rows][:, columns]
        for number, value in enumerate(VALUES):
            for other in range(3):
                matrix[number, other] += ((mask == value) & (said == other)).sum()
    union = matrix.sum(0) + matrix.sum(1) - matrix.diagonal()
    ious = matrix.diagonal() / union
    right, count = matrix.diagonal().sum(), matrix.sum()
    names = ["road", "car", "sky"]
    return {"miou": ious.mean(), "pixel_accuracy": right / count, **{f"iou_{name}": iou for name, iou in zip(names, ious)}}


def depth(images, labels):
    found = []
    for image, label in zip(images, labels):
        truth = numpy.load(label) if label.suffix == ".npy" else numpy.asarray(Image.open(label))
        truth = truth.astype(numpy.float64) / 256
        said = 1 + 4 * image[..., 0] + 2 * image[..., 1] + image[..., 2]
        counts = (truth >= 0.5) & (truth <= FARTHEST)
        p, t = numpy.clip(said[counts].astype(numpy.float64), 0.5, FARTHEST), truth[counts]
        near = numpy.maximum(p / t, t / p) < 1.25
        found.append([(numpy.abs(p - t) / t).mean(), numpy.sqrt(((p - t) ** 2).mean()), near.mean()])
    return dict(zip(["abs_rel", "rmse", "delta_1.25"], numpy.mean(found, axis=0)))


def main(pdk, data, labels, summary):
    evaluation = json.loads(Path(summary).read_text())["evaluations"][0]
    metric = {"segmentation": segmentation, "depth": depth}[evaluation["task"]]
    pictures = sorted(Path(data).glob("*.png"))
    truths = [next(Path(labels).glob(f"{path.stem}.*")) for path in pictures]
    worst = 0
    with tempfile.TemporaryDirectory() as folder:
        for row in [None, *evaluation["rows"]]:
            images = [
                pixels(path if row is None else perturbed(pdk, path, place, row, folder)) for place, path in enumerate(pictures)
            ]
            plain = metric(images, truths)
            told = {total["name"]: total["value"] for total in (evaluation["original"] if row is None else row["totals"])}
            print(row and (row["label"], row["level"]), "plain", plain, "pdk", told)
            worst = max(worst, *(abs(plain[name] - told[name]) for name in plain))
            assert plain.keys() == told.keys()
    print("largest difference:", worst)
    return 0 if worst <= 1e-6 else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
