"""Calls the functions of the published tool in a checkout of its repository, for compare.py.

Only the module with its perturbations is loaded, and what that imports itself; the package around it needs far more. Overlays are
given as the tool's class prepares them: keyed and scaled to the frame once, still ones as a picture, moving ones as an endless
iterator of pictures. The videos themselves are replaced by drawn ones, since a checkout need not have them, and so are pictures that it lacks. The
tool reads some pictures from disk for every frame; here they are read once.
"""

import functools
import importlib
import inspect
import itertools
import sys
import types
from pathlib import Path

import cv2
import numpy as np

# The tool is older than NumPy 2, which has no other name for it.
if not hasattr(np, "int0"):
    np.int0 = np.intp

PACKAGE = "perturbationdrive"
NOTE = """The functions of the published tool are measured without the class around them. Overlays are keyed and scaled once, as in the published
tool, and drawn videos of 640x480 replace its own. It reads the pictures of `frost_filter`, `snow_filter` and `object_overlay` from disk for every frame; here they are in memory, and
drawn ones of 640x480 and 1280x720 replace those that were not available. Its `cutout_filter`, `impulse_noise`, `object_overlay` and overlays write into the frame that they are given, which spares them the copy that pdk makes."""
PICTURES = 20  # of a drawn video


class Published:
    """The perturbations of a checkout."""

    def __init__(self, checkout):
        folder = Path(checkout).resolve() / PACKAGE
        if not (folder / "perturbationfuncs.py").is_file():
            sys.exit(f"{checkout} is not a checkout of the published tool: it has no {PACKAGE}/perturbationfuncs.py")
        # A package of this name without its __init__.py, which imports frameworks for networks.
        package = types.ModuleType(PACKAGE)
        package.__path__ = [str(folder)]
        sys.modules[PACKAGE] = package
        self.functions = importlib.import_module(f"{PACKAGE}.perturbationfuncs")
        # For the tool alone, what it reads is kept.
        self.functions.cv2 = types.SimpleNamespace(**{**vars(cv2), "imread": functools.cache(reader(folder.parent))})
        self.overlays = {}

    def perturb(self, name, level, image):
        """The frame as the tool perturbs it."""
        function = getattr(self.functions, name, None)
        if not callable(function):
            raise NotImplementedError(name)
        given = [parameter for parameter in parameters(function) if parameter.default is parameter.empty]
        if len(given) == 2:
            return function(level, image)
        if len(given) != 3:
            raise NotImplementedError(name)
        key = (name, image.shape)
        if key not in self.overlays:
            pictures = drawn(image.shape)
            self.overlays[key] = itertools.cycle(pictures) if name.startswith("dynamic") else pictures[0]
        return function(level, image, self.overlays[key])


def reader(checkout):
    """Reads pictures of a checkout; those that it lacks are drawn."""

    def read(path, flags=cv2.IMREAD_COLOR):
        if (checkout / path).is_file():
            return cv2.imread(str(checkout / path), flags)
        if flags == cv2.IMREAD_COLOR:
            return np.ascontiguousarray(drawn((480, 640, 3))[0][:, :, :3])
        return drawn((720, 1280, 3))[0]

    return read


def parameters(function):
    """The parameters of a function, also behind a decorator that takes any arguments and does not say whose."""
    found = list(inspect.signature(function).parameters.values())
    if any(parameter.kind is parameter.VAR_POSITIONAL for parameter in found):
        behind = [cell.cell_contents for cell in function.__closure__ or () if callable(cell.cell_contents)]
        if len(behind) == 1:
            return parameters(behind[0])
    return found


def drawn(shape):
    """Pictures with opacity, of which a fifth is covered."""
    random = np.random.default_rng(7)
    pictures = []
    for _ in range(PICTURES):
        picture = np.zeros((480, 640, 4), np.uint8)
        for x, y in random.integers((0, 0), (640, 480), (60, 2)).tolist():
            cv2.circle(picture, (x, y), 18, (200, 200, 200, 255), -1)
        pictures.append(cv2.resize(picture, (shape[1], shape[0]), interpolation=cv2.INTER_NEAREST))
    return pictures
