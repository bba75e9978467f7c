"""Measures kornia-rs, fast_image_resize and libblur for compare.py, with the program in crates/, which Cargo builds.

A crate is measured with a perturbation if its functions make the same picture as pdk. Each picture is compared with pdk's, and a figure
for another picture is refused. None of the three has a function for contrast or noise. Enlargements of whole frames are not the zoom of
`zoom_blur`, and libblur's `filter_2d` computes bytes with weights of at most 1, while `sharpen_filter` has larger ones.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

FOLDER = Path(__file__).resolve().parent / "crates"
#: The libraries, and the crate of each whose version is its own.
LIBRARIES = {"kornia-rs": "kornia-imgproc", "fast_image_resize": "fast_image_resize", "libblur": "libblur"}
#: The largest mean difference from pdk's picture, in grey levels.
MOST = 1.5
NOT_MEASURED = f"{', '.join(LIBRARIES)} were not measured, because Cargo could not build them."


def built(root, frames):
    """The crates, ready to be measured with these frames; nothing if they cannot be built."""
    command = ["cargo", "build", "--release", "--quiet", "--locked", "--manifest-path", FOLDER / "Cargo.toml", "--target-dir", root / "target/speed-crates"]
    try:
        subprocess.run(command, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"{NOT_MEASURED} {error}", file=sys.stderr)
        return None
    return Crates(root / "target/speed-crates/release/pdk-speed-crates", root / "target/release/pdk", frames)


class Crates:
    """The program that measures, and pdk's pictures of the frames."""

    def __init__(self, program, pdk, frames):
        self.pdk, self.frames = pdk, frames
        self.folder = tempfile.TemporaryDirectory()
        for size, frame in frames.items():
            cv2.imwrite(str(self.file(f"{size}.png")), frame[..., ::-1])
            self.file(size).write_bytes(frame.tobytes())
        # The last one, and how far others were from pdk's.
        self.picture, self.differences = (None, None), []
        # Memory that is freed is kept, as for the other libraries.
        kept = {"MALLOC_TRIM_THRESHOLD_": str(1 << 30), "MALLOC_MMAP_THRESHOLD_": str(32 << 20)}
        self.program = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=os.environ | kept)

    def file(self, name):
        return Path(self.folder.name) / name

    def work(self, library, name, level, p):
        """What a library does for a perturbation; nothing if it has no functions for it."""
        return Work(self, library, name, level, p) if task(library, name, p, next(iter(self.frames))) else None

    def median_ms(self, library, work, size):
        """The median processor time of a frame in milliseconds, and the picture of the frame."""
        made = self.file("made")
        asked = {"library": library, "work": work, "size": sides(size), "frame": str(self.file(size)), "picture": str(made)}
        self.program.stdin.write(json.dumps(asked) + "\n")
        self.program.stdin.flush()
        answer = json.loads(self.program.stdout.readline() or '{"error": "the program ended"}')
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer["ms"], np.frombuffer(made.read_bytes(), np.uint8).reshape(self.frames[size].shape)

    def perturbed(self, name, level, size):
        """The frame as pdk perturbs it."""
        if self.picture[0] != (name, level, size):
            out = self.file("pdk.png")
            subprocess.run([self.pdk, "perturb", self.file(f"{size}.png"), "--with", f"{name}@{level}", "-o", out], check=True, capture_output=True)
            self.picture = (name, level, size), cv2.imread(str(out))[..., ::-1]
        return self.picture[1]

    def note(self):
        """What is said of how they were measured."""
        differences = sorted(self.differences) or [0]
        return f"""kornia-rs, fast_image_resize and libblur are measured in Rust and not from Python, compiled as pdk is, with functions for bytes wherever
they have them (kornia-rs has hue, saturation and value for floats only) and with memory that is kept from frame to frame. On x86-64 much of
kornia-rs has no vector instructions yet, and what libblur has for AVX-512 needs a nightly compiler. Each of their pictures is compared with
pdk's: they differ by {differences[len(differences) // 2]:.1f} grey levels in the middle, and by {differences[-1]:.1f} at most. With a kernel of 3 pixels kornia-rs weighs 1, 2, 1, which
is not quite a Gaussian of that size. In `imagenet_c_gaussian_blur`
and `imagenet_c_defocus_blur` they compute with bytes, and pdk with floats, as imagecorruptions does."""


class Work:
    """What a library does for a perturbation at a level."""

    def __init__(self, crates, library, name, level, p):
        self.crates, self.library, self.name, self.level, self.p = crates, library, name, level, p

    def median_ms(self, size):
        """The median processor time of a frame in milliseconds. Fails if the picture is another than pdk's."""
        ms, made = self.crates.median_ms(self.library, task(self.library, self.name, self.p, size), size)
        difference = float(np.abs(np.int16(made) - self.crates.perturbed(self.name, self.level, size)).mean())
        if difference > MOST:
            raise RuntimeError(f"its picture differs from pdk's by {difference:.2f} grey levels in the mean, {size} at level {self.level}")
        self.crates.differences.append(difference)
        return ms


def versions():
    """The libraries with their versions, from the lock file."""
    locked = dict(re.findall(r'^name = "(.*)"\nversion = "(.*)"$', (FOLDER / "Cargo.lock").read_text(), re.MULTILINE))
    return ", ".join(f"{library} {locked[crate]}" for library, crate in LIBRARIES.items())


def sides(size):
    return [int(side) for side in size.split("x")]


def task(library, name, p, size):
    """What the program is asked to do for a perturbation, with pdk's parameters; nothing if the library cannot."""
    width, height = sides(size)

    def gaussian(pixels):
        pixels = 2 * round((pixels - 1) / 2) + 1
        return {"size": pixels, "sigma": 0.3 * ((pixels - 1) / 2 - 1) + 0.8}

    def cut_off():
        return {"gaussian": {"kernel": {"size": 2 * int(4 * p["sigma"] + 0.5) + 1, "sigma": p["sigma"]}, "edge": "nearest"}}

    def scaled():
        return [max(1, int(side * p["factor"])) for side in (width, height)]

    def weighed(kernel):
        return {"filter": {"side": len(kernel), "weights": (kernel / kernel.sum()).flatten().tolist(), "edge": "mirrored"}}

    def hsv(saturation=(1, 0), value=(1, 0)):
        return {"hsv": {channel: dict(zip(("factor", "added"), change)) for channel, change in (("saturation", saturation), ("value", value))}}

    def rotation():
        return cv2.getRotationMatrix2D((width / 2, height / 2), p["degrees"], 1).flatten().tolist()

    blurs = {
        "gaussian_blur": lambda: {"gaussian": {"kernel": gaussian(p["kernel_size"]), "edge": "mirrored"}},
        "high_pass_filter": lambda: {"high_pass": gaussian(p["kernel_size"])},
        "imagenet_c_gaussian_blur": cut_off,
    }
    resizes = {
        "pixelate": lambda: {"pixelate": scaled()},
        "scale_image": lambda: {"centre": scaled()},
        "reflection_filter": lambda: {"reflect": int(height * p["share"])},
    }
    by_library = {
        "libblur": blurs | {
            "defocus_blur": lambda: weighed(disc(p["radius"])),
            "motion_blur": lambda: weighed(line(p["size"], p["degrees"])),
            "imagenet_c_defocus_blur": lambda: weighed(soft_disc(p["radius"], p["edge"])),
        },
        "fast_image_resize": resizes | {"imagenet_c_pixelate": lambda: {"blocks": scaled()}},
        "kornia-rs": blurs | resizes | {
            "low_pass_filter": lambda: {"low_pass": gaussian(p["kernel_size"])},
            "shear_image": lambda: {"warp": [1, p["factor"], 0, 0, 1, 0]},
            "translate_image": lambda: {"warp": [1, 0, p["shift"], 0, 1, -p["shift"]]},
            "rotate_image": lambda: {"warp": rotation()},
            "increase_brightness": lambda: hsv(value=(p["factor"], 0)),
            "saturation_filter": lambda: hsv(saturation=(p["factor"], 0)),
            "saturation_decrease_filter": lambda: hsv(saturation=(p["factor"], 0)),
            "imagenet_c_brightness": lambda: hsv(value=(1, p["added"])),
            "imagenet_c_saturate": lambda: hsv(saturation=(p["factor"], p["added"])),
            "grayscale_filter": lambda: {"grey": p["weight"]},
            "histogram_equalisation": lambda: {"equalise": p["clip_limit"]},
            "canny_edges_mapping": lambda: {"edges": {"low": p["low_threshold"], "high": p["high_threshold"], "weight": p["weight"]}},
        },
    }
    make = by_library[library].get(name)
    return make and make()


def disc(radius):
    r = int(radius)
    y, x = np.mgrid[-r : r + 1, -r : r + 1]
    return (x * x + y * y <= r * r).astype(np.float32)


def soft_disc(radius, edge):
    """The disc of imagecorruptions."""
    reach, size = (8, 3) if radius <= 8 else (int(np.ceil(radius)), 5)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return cv2.GaussianBlur((x * x + y * y <= radius * radius).astype(np.float32), (size, size), edge)


def line(size, degrees):
    """One pixel in each row, along a line through the middle; an even size has its middle right and below of the centre."""
    size = max(int(size), 1)
    middle = size // 2
    kernel = np.zeros((2 * middle + 1, 2 * middle + 1), np.float32)
    for down in range(-middle, size - middle):
        column = int(np.tan(np.radians(degrees)) * down + middle)
        if 0 <= column < size:
            kernel[down + middle, column] = 1
    return kernel
