"""Measures how steady networks paint: the warping error of consecutive frames over the contrast, in each of the conditions.

    pdk run scripts/training/repaint/drives.lua --out held-out --set road_seed=9001 --set roads=4
    python scripts/training/repaint/measure.py held-out scripts/painters/night.onnx scripts/painters/rainy.onnx

The record is of roads that no network was trained on. The second frame of a pair is moved to where its places were in the first. The
error is the root mean square of the difference, where both show the same place. The contrast is the mean standard deviation of the pictures.
"""

import argparse
import pathlib

import onnxruntime
import torch

from scenes import Drives, warped


def painted(path, images):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    model = onnxruntime.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])
    return torch.cat([torch.from_numpy(model.run(None, {"image": image[None].numpy()})[0]) for image in images.float()])


def unsteady(pictures, drives, chosen):
    """The warping error over the contrast, from the pictures of all frames."""
    error = count = contrast = 0
    for first in chosen:
        pair, seen = pictures[first:first + 2].float(), drives.seen[first]
        error += (((warped(pair[1:], drives.places[first:first + 1]) - pair[:1]) ** 2) * seen).sum()
        count += 3 * seen.sum()
        contrast += pair[0].std()
    return ((error / count).sqrt() / (contrast / len(chosen))).item()


def main():
    parser = argparse.ArgumentParser(description="Measures how steady networks paint on a record of drives.lua.")
    parser.add_argument("record", type=pathlib.Path)
    parser.add_argument("networks", nargs="*", type=pathlib.Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    drives = Drives(arguments.record)
    conditions = list(dict.fromkeys(drives.conditions))
    print("| | " + " | ".join(conditions) + " |\n|---|" + "---:|" * len(conditions))
    for path in [None, *arguments.networks]:
        pictures = drives.images["day"] if path is None else painted(path, drives.images["day"])
        found = [unsteady(pictures, drives, [i for i in drives.first.tolist() if drives.conditions[i] == name]) for name in conditions]
        print(f"| {path or 'the drive itself'} | " + " | ".join(f"{value:.3f}" for value in found) + " |", flush=True)


if __name__ == "__main__":
    main()
