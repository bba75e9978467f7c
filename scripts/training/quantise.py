"""Quantises a network that comes with pdk: its convolutions compute with integers of 8 bits.

    pdk run collect --out training-data
    python scripts/training/quantise.py scripts/models/dave2.onnx training-data --out scripts/models/dave2_quantised.onnx --held-out other-data

Weights get a scale for each filter. What goes through the network gets the range that it has on some of the recorded images. The connected layers,
which are little work, stay as they are. Prints how far the controls differ, on images that were not used, and how far both are from what would
have been right.
"""

import argparse
import pathlib
import tempfile

import numpy as np
import onnx
import onnxruntime
from onnxruntime import quantization

import records

IMAGES = 500  # for the ranges


class Images(quantization.CalibrationDataReader):
    """Some images of a record, the same distance apart, with their speeds."""

    def __init__(self, images, speeds):
        chosen = np.linspace(0, len(images) - 1, IMAGES).astype(int)
        self.left = iter([inputs(images[at], speeds[at]) for at in chosen])

    def get_next(self):
        return next(self.left, None)


def inputs(image, speed):
    """An image and a speed as the network takes them."""
    return {"image": image.numpy()[None].astype(np.float32), "speed": speed.numpy()[None]}


def controls(path, images, speeds):
    """What a network makes of images."""
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return np.concatenate([session.run(None, inputs(*both))[0] for both in zip(images, speeds)])


def main():
    parser = argparse.ArgumentParser(description="Quantises the convolutions of a driving network.")
    parser.add_argument("network", type=pathlib.Path)
    parser.add_argument("record", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="the file of the quantised network")
    parser.add_argument("--held-out", type=pathlib.Path, required=True, help="a record of other roads")
    arguments = parser.parse_args()

    images, speeds, *_ = records.samples(arguments.record)
    with tempfile.TemporaryDirectory() as folder:
        prepared = pathlib.Path(folder) / "prepared.onnx"
        quantization.quant_pre_process(arguments.network, prepared, skip_symbolic_shape=True)
        quantization.quantize_static(
            prepared, arguments.out, Images(images, speeds), op_types_to_quantize=["Conv", "Relu"], per_channel=True,
            nodes_to_exclude=[node.name for node in onnx.load(prepared).graph.node if "connected" in node.name],
            activation_type=quantization.QuantType.QUInt8, weight_type=quantization.QuantType.QInt8,
        )

    images, speeds, labels, _ = records.samples(arguments.held_out)
    right = labels[:, :2].numpy()
    before, after = (controls(path, images, speeds) for path in (arguments.network, arguments.out))
    print(f"{len(images)} images; mean and largest difference of steering and throttle:")
    difference = np.abs(after - before)
    print(" ", difference.mean(0).round(5), difference.max(0).round(4))
    print("mean error of the network and of the quantised one:")
    print(" ", np.abs(before - right).mean(0).round(5), np.abs(after - right).mean(0).round(5))


if __name__ == "__main__":
    main()
