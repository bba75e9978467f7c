"""What the tests of the Python package share. They run against the installed package, see CONTRIBUTING.md."""

import os
import subprocess
import tempfile

import numpy
import pytest

# Nothing of the user's: the folder is empty, and is removed at the end.
NOTHING = tempfile.TemporaryDirectory()
os.environ["XDG_DATA_HOME"] = NOTHING.name
os.environ.pop("PDK_PLUGIN_PATH", None)

import pdk_perturb as pdk  # noqa: E402


@pytest.fixture(scope="session")
def image():
    """A picture with edges, colours and shades; odd in both directions."""
    height, width = 97, 131
    y, x = numpy.mgrid[0:height, 0:width]
    waves = [128 + 100 * numpy.sin(x / (5 + channel) + y / (9 - channel)) for channel in range(3)]
    picture = numpy.stack(waves, axis=2)
    picture[30:60, 40:90] = (200, 40, 20)
    picture[70:, :50] = (20, 90, 230)
    return picture.clip(0, 255).astype(numpy.uint8)


@pytest.fixture(scope="session")
def command(tmp_path_factory, image):
    """Perturbs the image with the command line: perturbations and options in, pixels out."""
    from PIL import Image

    folder = tmp_path_factory.mktemp("command")
    source = folder / "image.png"
    Image.fromarray(image).save(source)

    def run(*perturbations, options=(), seed=0):
        out = folder / "out.png"
        given = [part for perturbation in perturbations for part in ("--with", perturbation)]
        line = [pdk.executable(), *options, "perturb", source, *given, "--seed", str(seed), "-o", out]
        done = subprocess.run([str(part) for part in line], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return numpy.asarray(Image.open(out).convert("RGB"))

    return run
