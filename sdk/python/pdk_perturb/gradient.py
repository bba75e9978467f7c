"""Exact gradients of networks in ONNX files, whatever framework has trained them.

    gradient = pdk.Gradient("pilot.onnx", of="steering")
    slope = gradient(image)                       # as large as the image
    value, slope = gradient.with_value(image)

    loss = pdk.Gradient("pilot.onnx", of="squared_error(steering)", by="weights")
    value, slopes = loss.with_value(image, target=[[0.2]])

The gradient is itself a network, which `pdk gradient` writes. Here the package onnxruntime runs it.
"""

import json
import subprocess
import tempfile
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class Gradient:
    """The gradient of a number that a network computes.

    `model` is the path of an ONNX file. `of` says what the gradient is taken of: a value of the network with one number, `VALUE[PLACE]`,
    `sum(VALUE)`, `mean(VALUE)`, `squared_error(VALUE)`, `absolute_error(VALUE)`, `cross_entropy(VALUE)`, or terms of these such as `"steering + 0.1 *
    mean(throttle)"`; None for the only number that the network computes. `by` says with respect to what: names of inputs, layers, values or weights, or
    `"weights"` for all weights; None for all inputs of floats. `options` are those of `onnxruntime.InferenceSession`, such as `providers`.

    Raises `pdk.Error` if an operator has no gradient or a name is not known, and ImportError without the package onnxruntime.
    """

    def __init__(
        self,
        model: "str | PathLike[str]",
        of: "str | None" = None,
        by: "str | Iterable[str] | None" = None,
        **options: Any,
    ) -> None:
        try:
            import onnxruntime
        except ImportError as error:
            raise ImportError("pdk.Gradient runs networks with onnxruntime: pip install onnxruntime") from error
        from pdk_perturb import Error, executable

        names = [by] if isinstance(by, str) else list(by or ())
        if not isinstance(model, (str, PathLike)):
            raise TypeError(f"model is {type(model).__name__}, but has to be the path of an ONNX file")
        with tempfile.TemporaryDirectory(prefix="pdk-gradient-") as folder:
            file = Path(folder) / "gradient.onnx"
            command = [executable(), "gradient", Path(model), "--out", file, "--json"]
            command += [] if of is None else [f"--of={of}"]
            command += [f"--by={name}" for name in names]
            written = subprocess.run(command, capture_output=True, text=True)
            if written.returncode:
                raise Error(written.stderr.strip().removeprefix("pdk: error: "))
            described = json.loads(written.stdout)
            options.setdefault("providers", onnxruntime.get_available_providers())
            self._session = onnxruntime.InferenceSession(file.read_bytes(), **options)
        #: What the gradient is taken of, as it was understood.
        self.objective = described["objective"]
        #: The names of the inputs with their shapes; a target is one of them.
        self.inputs = {entry["name"]: tuple(entry["shape"]) for entry in described["inputs"]}
        self._outputs = [entry["name"] for entry in described["outputs"]]
        #: The names of what the gradient is taken with respect to.
        self.by = [name.removeprefix("gradient/") for name in self._outputs[1:]]

    def __call__(self, *inputs: "ArrayLike", **named: "ArrayLike") -> "NDArray[Any] | dict[str, NDArray[Any]]":
        """The gradients, as `with_value` returns them."""
        return self.with_value(*inputs, **named)[1]

    def with_value(
        self, *inputs: "ArrayLike", **named: "ArrayLike"
    ) -> "tuple[float, NDArray[Any] | dict[str, NDArray[Any]]]":
        """The number, and the gradients: an array if there is one, else a dictionary by name.

        Arrays belong to the inputs in their order, or by name; they are converted to the type of their input.
        """
        number, *gradients = self._session.run(self._outputs, self._arrays(inputs, named))
        return float(number), gradients[0] if len(gradients) == 1 else dict(zip(self.by, gradients, strict=True))

    def _arrays(
        self, inputs: "tuple[ArrayLike, ...]", named: "dict[str, ArrayLike]"
    ) -> "dict[str, NDArray[Any]]":
        import numpy

        if len(inputs) > len(self.inputs):
            raise TypeError(f"{len(inputs)} arrays are given, but the inputs are {', '.join(self.inputs)}")
        given = dict(zip(self.inputs, inputs, strict=False))
        twice = [name for name in named if name in given]
        unknown = [name for name in named if name not in self.inputs]
        missing = [name for name in self.inputs if name not in given and name not in named]
        for names, what in ((twice, "given twice"), (unknown, "not an input"), (missing, "missing")):
            if names:
                raise TypeError(f"`{names[0]}` is {what}; the inputs are {', '.join(self.inputs)}")
        types = {"tensor(float)": numpy.float32, "tensor(double)": numpy.float64, "tensor(int64)": numpy.int64}
        arrays = {}
        for entry in self._session.get_inputs():
            array = numpy.asarray((given | named)[entry.name])
            array = numpy.ascontiguousarray(array, types.get(entry.type, array.dtype))
            shape = self.inputs[entry.name]
            if array.shape != shape:
                raise ValueError(f"`{entry.name}` has the shape {array.shape}, but has to have {shape}")
            arrays[entry.name] = array
        return arrays
