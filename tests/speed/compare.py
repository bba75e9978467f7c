"""Measures pdk beside other libraries, in one run on one thread, and writes docs/speed.md.

    cargo build --release && cargo run --release -p pdk-dist -- --profile release --no-package --wheel
    python -m venv venv && venv/bin/pip install -r tests/speed/requirements.txt target/pdk-dist/pdk_perturb-*.whl
    venv/bin/python tests/speed/compare.py --only contrast,gaussian_blur --levels 0,4     # a try, prints only
    venv/bin/python tests/speed/compare.py --write                                        # all, on a quiet machine

pdk is measured by its benchmark (tests/benches/speed.rs) and, where its wheel is installed, called from Python; the others here:
plain OpenCV as one would write the perturbation with it, albumentations where it has the same effect, imagecorruptions beside pdk's
suite of the same corruptions, and the Rust crates of rust_crates.py, which Cargo builds (minutes, the first time). All get the same
frames of the embedded simulator, with parameters as near to pdk's as they allow; all times are medians of the thread's processor time,
and a single time for what takes long. What a library does not have stays empty. The published tool is on no package index: --published
names a checkout of its repository.
"""

import argparse
import ctypes
import functools
import importlib
import importlib.metadata
import itertools
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"
os.environ["NO_ALBUMENTATIONS_UPDATE"] = "1"

import cv2  # noqa: E402
import numpy as np  # noqa: E402

import rust_crates  # noqa: E402

cv2.setNumThreads(1)


def keep_memory():
    """Makes the allocator keep what is freed, so that no library pays for fresh pages and another not, as chance has it."""
    trim_threshold, mmap_threshold = -1, -3
    for parameter, size in ((trim_threshold, 1 << 30), (mmap_threshold, 32 << 20)):
        if ctypes.CDLL(None).mallopt(parameter, size) != 1:
            sys.exit("the allocator cannot be told to keep memory; this needs glibc")


keep_memory()

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/speed.md"
#: Around the table of the loop, which can be measured alone.
MARKS = ("<!-- loop -->\n", "<!-- end of loop -->")
LEVELS = range(5)
BUDGET = 0.04  # Seconds for a figure.
LONG = 0.25  # Seconds; what takes longer is measured once.
RANDOM = np.random.default_rng(1)


# ---------------------------------------------------------------------------------------------------------------------
# What the others do. A library is a function from perturbation, level and pdk's parameters there to a function of the
# frame, or to nothing.


def opencv(name, level, p):
    """The perturbation as one would write it with OpenCV and numpy, without state from frame to frame."""

    def affine(matrix):
        return lambda f: cv2.warpAffine(f, np.float32(matrix), (f.shape[1], f.shape[0]))

    def blurred(size):
        size = int(size) | 1
        return lambda f: cv2.GaussianBlur(f, (size, size), 0)

    def of_value(change):
        def run(f):
            hsv = cv2.cvtColor(f, cv2.COLOR_RGB2HSV)
            change(hsv)
            return cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)

        return run

    def noisy(noise):
        def run(f):
            return np.clip(noise(f.astype(np.float32)), 0, 255).astype(np.uint8)

        return run

    def kernel(k):
        k = k / k.sum()
        return lambda f: cv2.filter2D(f, -1, k)

    def rotated(f):
        matrix = cv2.getRotationMatrix2D((f.shape[1] / 2, f.shape[0] / 2), p["degrees"], 1)
        return cv2.warpAffine(f, matrix, (f.shape[1], f.shape[0]))

    def scaled(f):
        h, w = f.shape[:2]
        small = cv2.resize(f, (max(1, int(w * p["factor"])), max(1, int(h * p["factor"]))))
        out = np.zeros_like(f)
        y, x = (h - small.shape[0]) // 2, (w - small.shape[1]) // 2
        out[y : y + small.shape[0], x : x + small.shape[1]] = small
        return out

    def reflected(f):
        rows = max(1, int(f.shape[0] * p["share"]))
        return cv2.resize(np.vstack([f, f[-rows:][::-1]]), (f.shape[1], f.shape[0]))

    def pixelated(f):
        h, w = f.shape[:2]
        small = cv2.resize(f, (max(1, int(w * p["factor"])), max(1, int(h * p["factor"]))))
        return cv2.resize(small, (w, h))

    def elastic(f):
        h, w = f.shape[:2]
        y, x = np.mgrid[0:h, 0:w].astype(np.float32)
        shift = [
            cv2.GaussianBlur(RANDOM.uniform(-1, 1, (h, w)).astype(np.float32) * p["alpha"], (0, 0), p["sigma"])
            for _ in range(2)
        ]
        return cv2.remap(f, x + shift[0], y + shift[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)

    def zoomed(f):
        h, w = f.shape[:2]
        out = f.astype(np.float32)
        steps = [(1.01, 0.01), (1.11, 0.01), (1.14, 0.02), (1.2, 0.02), (1.3, 0.03)][level]
        factors = np.arange(1, steps[0] + 1e-9, steps[1])
        for z in factors:
            ch, cw = math.ceil(h / z), math.ceil(w / z)
            y, x = (h - ch) // 2, (w - cw) // 2
            out += cv2.resize(f[y : y + ch, x : x + cw], (w, h))
        return (out / (len(factors) + 1)).astype(np.uint8)

    def jpeg(f):
        ok, data = cv2.imencode(".jpg", f, [cv2.IMWRITE_JPEG_QUALITY, int(p["quality"])])
        return cv2.imdecode(data, cv2.IMREAD_COLOR)

    def impulses(f):
        out = f.copy()
        h, w = f.shape[:2]
        count = math.ceil(p["fraction"] * h * w * 1.5)
        for value in (255, 0):
            out[RANDOM.integers(0, h, count), RANDOM.integers(0, w, count), RANDOM.integers(0, 3, count)] = value
        return out

    def canny(f):
        edges = cv2.Canny(cv2.cvtColor(f, cv2.COLOR_RGB2GRAY), 50, 150)
        return np.where(edges[..., None] > 0, np.uint8([0, 0, 255]), f)

    def equalised(f):
        lab = cv2.cvtColor(f, cv2.COLOR_RGB2LAB)
        lab[..., 0] = cv2.createCLAHE(2.0, (8, 8)).apply(lab[..., 0])
        return cv2.cvtColor(lab, cv2.COLOR_LAB2RGB)

    def grey(f):
        g = cv2.cvtColor(cv2.cvtColor(f, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)
        return cv2.addWeighted(f, 1 - p["weight"], g, p["weight"], 0)

    def paired(f):
        h, w = f.shape[:2]
        y, x = RANDOM.integers(0, h // 2), RANDOM.integers(0, w // 2)
        return cv2.addWeighted(f, p["weight"], cv2.resize(f[y : y + h // 2, x : x + w // 2], (w, h)), 1 - p["weight"], 0)

    def high_pass(f):
        size = int(p["kernel_size"]) | 1
        return cv2.addWeighted(f, 2, cv2.GaussianBlur(f, (size, size), 0), -1, 0)

    def sharpened(f):
        k = -np.ones((3, 3), np.float32)
        k[1, 1] = 9 + level
        return cv2.addWeighted(f, 1 - 0.1 * (level + 1), cv2.filter2D(f, -1, k), 0.1 * (level + 1), 0)

    def fogged(f):
        noise = RANDOM.normal(0, 255 * p["noise"], f.shape).astype(np.float32)
        layer = np.clip((1 - p["noise"]) * 255 + p["noise"] * noise, 0, 255)
        return ((1 - p["strength"]) * f + p["strength"] * layer).astype(np.uint8)

    def white_balanced(f):
        lab = cv2.cvtColor(f, cv2.COLOR_RGB2LAB).astype(np.float32)
        light = lab[..., 0] / 255
        for channel in (1, 2):
            lab[..., channel] -= (lab[..., channel].mean() - 128) * light * 1.1
        return cv2.cvtColor(np.clip(lab, 0, 255).astype(np.uint8), cv2.COLOR_LAB2RGB)

    def disc(radius):
        r = int(radius)
        y, x = np.mgrid[-r : r + 1, -r : r + 1]
        return ((x * x + y * y) <= r * r).astype(np.float32)

    def line(size, degrees):
        size = max(int(size), 1)
        k, c = np.zeros((size, size), np.float32), size // 2
        for y in range(size):
            x = int(math.tan(math.radians(degrees)) * (y - c) + c)
            if 0 <= x < size:
                k[y, x] = 1
        return k

    def saturation(f):
        f[..., 1] = cv2.convertScaleAbs(f[..., 1], alpha=float(next(iter(p.values()))))

    def brightness(f):
        f[..., 2] = cv2.convertScaleAbs(f[..., 2], alpha=p["factor"])

    def low_pass(f):
        size = int(p["kernel_size"]) | 1
        f[..., 2] = cv2.GaussianBlur(f[..., 2], (size, size), 0)

    by_name = {
        "gaussian_blur": lambda: blurred(p["kernel_size"]),
        "low_pass_filter": lambda: of_value(low_pass),
        "defocus_blur": lambda: kernel(disc(p["radius"])),
        "motion_blur": lambda: kernel(line(p["size"], p["degrees"])),
        "zoom_blur": lambda: zoomed,
        "increase_brightness": lambda: of_value(brightness),
        "contrast": lambda: lambda f: cv2.convertScaleAbs(f, alpha=p["factor"], beta=127.5 * (1 - p["factor"])),
        "shear_image": lambda: affine([[1, p["factor"], 0], [0, 1, 0]]),
        "translate_image": lambda: affine([[1, 0, p["shift"]], [0, 1, -p["shift"]]]),
        "rotate_image": lambda: rotated,
        "scale_image": lambda: scaled,
        "reflection_filter": lambda: reflected,
        "pixelate": lambda: pixelated,
        "elastic": lambda: elastic,
        "jpeg_filter": lambda: jpeg,
        "impulse_noise": lambda: impulses,
        "gaussian_noise": lambda: noisy(lambda f: f + RANDOM.normal(0, 255 * p["sigma"], f.shape)),
        "speckle_noise_filter": lambda: noisy(lambda f: f * RANDOM.normal(1, p["sigma"], f.shape)),
        "poisson_noise": lambda: noisy(lambda f: RANDOM.poisson(f / 255 * p["k"]) / p["k"] * 255),
        "canny_edges_mapping": lambda: canny,
        "histogram_equalisation": lambda: equalised,
        "grayscale_filter": lambda: grey,
        "sample_pairing_filter": lambda: paired,
        "high_pass_filter": lambda: high_pass,
        "sharpen_filter": lambda: sharpened,
        "fog_filter": lambda: fogged,
        "white_balance_filter": lambda: white_balanced,
        "saturation_filter": lambda: of_value(saturation),
        "saturation_decrease_filter": lambda: of_value(saturation),
        "false_color_filter": lambda: lambda f: np.ascontiguousarray(f[..., ::-1]),
    }
    return by_name[name]() if name in by_name else None


def albumentations(name, level, p):
    """The transform of albumentations with the same effect, made once, applied to each frame."""
    import albumentations as a

    def both(value):
        return (value, value)

    def odd(value):
        return max(3, int(value) | 1)

    by_name = {
        "gaussian_blur": lambda: a.GaussianBlur(blur_limit=both(odd(p["kernel_size"])), sigma_limit=both(0.3 * ((odd(p["kernel_size"]) - 1) * 0.5 - 1) + 0.8), p=1),
        "defocus_blur": lambda: a.Defocus(radius=both(max(1, int(p["radius"]))), alias_blur=both(0.1), p=1),
        "motion_blur": lambda: a.MotionBlur(blur_limit=both(odd(p["size"])), p=1),
        "glass_blur": lambda: a.GlassBlur(sigma=0.7, max_delta=max(1, int(p["distance"])), iterations=1, p=1),
        "zoom_blur": lambda: a.ZoomBlur(max_factor=both([1.01, 1.11, 1.14, 1.2, 1.3][level]), step_factor=both([0.01, 0.01, 0.02, 0.02, 0.03][level]), p=1),
        "gaussian_noise": lambda: a.GaussNoise(std_range=both(p["sigma"]), p=1),
        "poisson_noise": lambda: a.ShotNoise(scale_range=both(1 / p["k"]), p=1),
        "impulse_noise": lambda: a.SaltAndPepper(amount=both(p["fraction"]), p=1),
        "speckle_noise_filter": lambda: a.MultiplicativeNoise(multiplier=(1 - p["sigma"], 1 + p["sigma"]), per_channel=True, elementwise=True, p=1),
        "jpeg_filter": lambda: a.ImageCompression(quality_range=both(int(p["quality"])), p=1),
        "increase_brightness": lambda: a.HueSaturationValue(hue_shift_limit=both(0), sat_shift_limit=both(0), val_shift_limit=both(127.5 * (p["factor"] - 1)), p=1),
        "contrast": lambda: a.RandomBrightnessContrast(brightness_limit=both(0), contrast_limit=both(p["factor"] - 1), p=1),
        "elastic": lambda: a.ElasticTransform(alpha=p["alpha"], sigma=max(1, p["sigma"]), p=1),
        "pixelate": lambda: a.Downscale(scale_range=both(p["factor"]), p=1),
        "sharpen_filter": lambda: a.Sharpen(alpha=both(0.1 * (level + 1)), lightness=both(1), p=1),
        "shear_image": lambda: a.Affine(shear={"x": both(math.degrees(math.atan(p["factor"]))), "y": (0, 0)}, p=1),
        "translate_image": lambda: a.Affine(translate_px={"x": both(int(p["shift"])), "y": both(-int(p["shift"]))}, p=1),
        "rotate_image": lambda: a.Affine(rotate=both(p["degrees"]), p=1),
        "scale_image": lambda: a.Affine(scale=both(p["factor"]), p=1),
        "grayscale_filter": lambda: a.ColorJitter(brightness=both(1), contrast=both(1), saturation=both(1 - p["weight"]), hue=both(0), p=1),
        "histogram_equalisation": lambda: a.CLAHE(clip_limit=both(2.0), p=1),
        "posterize_filter": lambda: a.Posterize(num_bits=both(max(1, 6 - level)), p=1),
        "saturation_filter": lambda: a.HueSaturationValue(hue_shift_limit=both(0), sat_shift_limit=both(20 * (level + 1)), val_shift_limit=both(0), p=1),
        "saturation_decrease_filter": lambda: a.HueSaturationValue(hue_shift_limit=both(0), sat_shift_limit=both(-20 * (level + 1)), val_shift_limit=both(0), p=1),
        "cutout_filter": lambda: a.CoarseDropout(num_holes_range=both(level + 1), hole_height_range=both(0.2), hole_width_range=both(0.2), p=1),
        "dynamic_rain_filter": lambda: a.RandomRain(p=1),
        "dynamic_snow_filter": lambda: a.RandomSnow(p=1),
        "dynamic_sun_filter": lambda: a.RandomSunFlare(p=1),
        "fog_mapping": lambda: a.RandomFog(fog_coef_range=both(p["strength"]), p=1),
    }
    # It moves by whole pixels only.
    if name not in by_name or (name == "translate_image" and p["shift"] % 1):
        return None
    transform = by_name[name]()
    return lambda f: transform(image=f)["image"]


def imagecorruptions(name, level, _):
    """The corruption, at the severity that the level stands for."""
    corrupt = corruptions().corrupt
    suite, _, corruption = name.partition("imagenet_c_")
    if suite or not corruption:
        return None
    return lambda f: corrupt(f, corruption_name=corruption, severity=level + 1)


@functools.cache
def corruptions():
    """imagecorruptions 1.1.2, with what it calls in the present releases of numpy and scikit-image."""
    import skimage.filters

    np.float_ = np.float64
    smooth = skimage.filters.gaussian

    def gaussian(image, *arguments, multichannel=False, **named):
        return smooth(image, *arguments, channel_axis=-1 if multichannel else None, **named)

    module = importlib.import_module("imagecorruptions")
    importlib.import_module("imagecorruptions.corruptions").gaussian = gaussian
    return module


def published(checkout):
    """The published tool in a checkout of its repository, and what is said of how it was measured."""
    import published as module

    tool = module.Published(checkout)
    return lambda name, level, _: lambda f: tool.perturb(name, level, f), module.NOTE


def from_python():
    """pdk's function for arrays, everything drawn anew for every call; nothing if the wheel is not installed."""
    try:
        import pdk_perturb as pdk
    except ImportError:
        print("pdk is not installed here, so calls from Python are not measured", file=sys.stderr)
        return lambda *_: None
    seeds = itertools.count()
    return lambda name, level: lambda f: pdk.perturb(f, f"{name}@{level}", seed=next(seeds))


# ---------------------------------------------------------------------------------------------------------------------
# Measuring.


def median_ms(work, frame):
    """The median processor time of the thread for a call, in milliseconds; a single one if it takes long."""

    def seconds():
        given = frame.copy()
        before = time.thread_time()
        work(given)
        return time.thread_time() - before

    first = seconds()
    # The first call may prepare what later ones use.
    second = seconds() if first < 4 * LONG else first
    if second > LONG:
        return 1e3 * second
    times, started = [], time.thread_time()
    while len(times) < 7 or (time.thread_time() - started < BUDGET and len(times) < 2000):
        times.append(seconds())
    return 1e3 * sorted(times)[len(times) // 2]


def parameters():
    """Of each perturbation the parameters that have a value for each level, and the others' defaults."""
    listed = subprocess.run([ROOT / "target/release/pdk", "list", "perturbation", "--json"], capture_output=True, check=True, text=True)
    found = {}
    for component in json.loads(listed.stdout):
        description = component["description"]
        of_level = []
        for level in LEVELS:
            values = {}
            for parameter in description["parameters"]:
                levels = parameter.get("levels")
                values[parameter["name"]] = levels[level] if levels else parameter.get("default")
            of_level.append(values)
        found[description["name"]] = of_level
    return found


def measure_loop():
    """The figures of the loop alone."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["cargo", "bench", "-q", "-p", "pdk-tests", "--bench", "speed", "--", "--json", f"{folder}/pdk.json", "--sizes", "320x240", "--only", "loop"]
        subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        return json.loads(Path(f"{folder}/pdk.json").read_text())


def measure(options):
    """All figures: pdk's and those of each library, by perturbation, size and level."""
    known = parameters()
    with tempfile.TemporaryDirectory() as folder:
        command = ["cargo", "bench", "-q", "-p", "pdk-tests", "--bench", "speed", "--", "--json", f"{folder}/pdk.json"]
        command += ["--frames", folder, "--sizes", ",".join(options.sizes)]
        if options.only or options.without_loop:
            command += ["--only", ",".join(options.only or known)]
        subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        figures = json.loads(Path(f"{folder}/pdk.json").read_text())
        frames = {size: cv2.imread(f"{folder}/{size}.png")[..., ::-1].copy() for size in options.sizes}
    libraries = {"OpenCV": opencv, "albumentations": albumentations, "imagecorruptions": imagecorruptions}
    crates = rust_crates.built(ROOT, frames)
    if crates:
        libraries |= {library: functools.partial(crates.work, library) for library in rust_crates.LIBRARIES}
    if options.published:
        libraries["published tool"], figures["note"] = published(options.published)
    failed, python = {}, from_python()
    figures["cells"] = [cell for cell in figures["cells"] if cell["level"] in options.levels]
    for cell in figures["cells"]:
        name, level, size = cell["perturbation"], cell["level"], cell["size"]
        cell["others"] = {}
        call = python(name, level)
        # What needs a file of the user's own has a parameter without a value.
        if call is not None and None not in known[name][level].values():
            cell["python_ms"] = median_ms(call, frames[size])
        for library, make in libraries.items():
            try:
                work = make(name, level, known[name][level])
                if isinstance(work, rust_crates.Work):
                    cell["others"][library] = work.median_ms(size)
                elif work is not None:
                    cell["others"][library] = median_ms(work, frames[size])
            except NotImplementedError:
                continue
            except Exception as error:  # A library that cannot do it is named, and goes without a figure.
                failed.setdefault((library, name), f"{type(error).__name__}: {error}")
        told = ", ".join(f"{library} {ms:.3f}" for library, ms in cell["others"].items())
        print(f"{name:<28} {size:>9} level {level}: pdk {cell['ms']:.3f} ms; {told}", flush=True)
    for (library, name), error in failed.items():
        print(f"{library} could not do {name}: {error}", file=sys.stderr)
    figures["libraries"] = list(libraries)
    figures["crates"] = crates.note() if crates else rust_crates.NOT_MEASURED
    figures["failed"] = [f"{library}, {name}" for library, name in failed]
    return figures


# ---------------------------------------------------------------------------------------------------------------------
# Tables.


# How pdk is measured, with what a table calls it.
WAYS = {
    "ms": "a frame of a sequence",
    "drawn_anew_ms": "the same, everything drawn anew for every frame",
    "python_ms": "a call from Python, everything drawn anew",
}


def ways(library):
    """What of pdk's times a library is compared with. Crates are called from Rust, and draw nothing."""
    return {"ms": WAYS["ms"]} if library in rust_crates.LIBRARIES else WAYS


def ours(cell, way):
    """pdk's time. Where nothing is kept for a sequence, everything is drawn anew anyway; calls from Python may not have been measured."""
    return cell.get(way) or (cell["ms"] if way == "drawn_anew_ms" else None)


def pairs(figures, library, way, size=None):
    """pdk's time and the library's, where both are there."""
    for cell in figures["cells"]:
        mine, theirs = ours(cell, way), cell["others"].get(library)
        if mine is not None and theirs is not None and size in (None, cell["size"]):
            yield mine, theirs


def faster(found):
    """The geometric mean of how many times faster pdk is."""
    return math.exp(sum(math.log(theirs / mine) for mine, theirs in found) / len(found))


def summary(figures):
    sizes = list(figures["copy_ms"])
    lines = [
        f"| one thread, every level; times as fast, geometric mean | {' | '.join(sizes)} | figures | pdk slower in |",
        "| --- |" + " ---: |" * (len(sizes) + 2),
    ]
    for library in figures["libraries"]:
        for way, told in ways(library).items():
            found = list(pairs(figures, library, way))
            if found:
                means = [f"{faster(list(pairs(figures, library, way, size))):.1f}" for size in sizes]
                slower = sum(mine > theirs for mine, theirs in found)
                lines.append(f"| {library}: {told} | {' | '.join(means)} | {len(found)} | {slower} |")
    lines += ["", "| a frame | milliseconds | copies |", "| --- | ---: | ---: |"]
    for size, ms in figures["copy_ms"].items():
        lines.append(f"| a copy of it, {size} | {ms:.4f} | 1 |")
    for size, ms in figures["copy_ms"].items():
        middle = statistics.median(copies(figures, name, size) for name in names(figures))
        lines.append(f"| the perturbation in the middle, {size} | {middle * ms:.2f} | {middle:.0f} |")
    for size, ms in figures["copy_ms"].items():
        worst = max((cell for cell in figures["cells"] if cell["size"] == size), key=lambda cell: cell["ms"])
        lines.append(
            f"| the slowest perturbation, {worst['perturbation']} at level {worst['level']}, {size} | {worst['ms']:.2f} | {worst['ms'] / ms:.0f} |"
        )
    return "\n".join(lines) + "\n"


def closed_loop(figures):
    """What a frame takes of the simulator and of all that is in the loop."""
    lines = ["| a frame of the loop | milliseconds |", "| --- | ---: |"]
    for row in figures["loop"]:
        real_time = f", {row['real_time_factor']:.0f} times real time" if "real_time_factor" in row else ""
        lines.append(f"| {row['what']} | {row['ms']:.2f}: {row['frames_per_second']:.0f} frames a second{real_time} |")
    return "\n".join(lines) + "\n"


def losses(figures):
    """Where pdk is slower, drawing no more than the other does, or called from Python, whichever is slower; the worst first."""
    found = []
    for cell in figures["cells"]:
        for library, theirs in cell["others"].items():
            times = max(ours(cell, way) or 0 for way in ("ms", "python_ms") if way in ways(library)) / theirs
            if times > 1:
                found.append((times, cell, library, theirs))
    if not found:
        return "Nowhere.\n"
    found.sort(key=lambda loss: -loss[0])
    lines = ["| perturbation | size | level | than | its ms | pdk ms | from Python | times slower, at worst |", "|---|---|---:|---|---:|---:|---:|---:|"]
    for times, cell, library, theirs in found:
        call = f"{cell['python_ms']:.3f}" if "python_ms" in cell and "python_ms" in ways(library) else ""
        lines.append(
            f"| {cell['perturbation']} | {cell['size']} | {cell['level']} | {library} | {theirs:.3f} | {cell['ms']:.3f} | {call} | {times:.2f} |"
        )
    return "\n".join(lines) + "\n"


def names(figures):
    """The perturbations, in the order in which they were measured."""
    return list(dict.fromkeys(cell["perturbation"] for cell in figures["cells"]))


def copies(figures, name, size):
    """How often a frame could be copied while pdk perturbs it: the median of the levels."""
    times = [cell["ms"] for cell in figures["cells"] if (cell["perturbation"], cell["size"]) == (name, size)]
    return statistics.median(times) / figures["copy_ms"][size]


def table(figures, size):
    """Milliseconds at levels 0 to 4, of pdk and of each library."""
    header = ["perturbation", "copies", "pdk", "drawn anew", "from Python", *figures["libraries"]]
    lines = ["| " + " | ".join(header) + " |", "|---|" + "---:|" * (len(header) - 1)]
    for name in names(figures):
        cells = [cell for cell in figures["cells"] if (cell["perturbation"], cell["size"]) == (name, size)]

        def column(value):
            values = [value(cell) for cell in cells]
            return "" if all(v is None for v in values) else " ".join("–" if v is None else f"{v:.3g}" for v in values)

        row = [name, f"{copies(figures, name, size):.0f}", column(lambda cell: cell["ms"]), column(lambda cell: cell.get("drawn_anew_ms")), column(lambda cell: cell.get("python_ms"))]
        row += [column(lambda cell, library=library: cell["others"].get(library)) for library in figures["libraries"]]
        lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines) + "\n"


def page(figures, loop):
    versions = f"numpy {np.__version__}, OpenCV {cv2.__version__}"
    for package in ("albumentations", "imagecorruptions"):
        try:
            versions += f", {package} {importlib.metadata.version(package)}"
        except importlib.metadata.PackageNotFoundError:
            pass
    versions += f", {rust_crates.versions()}"
    note = figures.get("note", "The published tool, which is on no package index, was not measured.")
    failed = f" Not measured, because it failed: {'; '.join(figures['failed'])}." if figures["failed"] else ""
    text = "# Speed\n\n*Written by `tests/speed/compare.py --write`; changes here are lost.*\n\n" + summary(figures)
    text += f"""
All figures come from one run on one thread of one machine{processor()}. They are medians of the thread's processor time, for frames after the first few
(pdk prepares textures and clips once and keeps them, and the memory of arrays too). "Copies" is the time divided by that of a
copy of the frame in the same run: of a perturbation in the tables by size the median of its levels, of the slowest at that level. {versions}.{failed}

Some perturbations draw the places of things once per sequence and keep them, while other libraries draw for every frame; "drawn anew" means
`draws=per_frame`. The other libraries do the nearest thing to pdk's perturbation that they have, with parameters as near as they allow: some do less
work, some more. Perturbations that change hue, saturation and value are compared with albumentations' `HueSaturationValue`, and grey with the
saturation of its `ColorJitter`, which also blends with grey. imagecorruptions is compared with pdk's suite of the same corruptions, `imagenet_c_...`.
{figures["crates"]} {note}

## The closed loop

By the clock, on two cores:

<!-- loop -->
{loop}
<!-- end of loop -->

## Where pdk is slower

{losses(figures)}"""
    for size in figures["copy_ms"]:
        text += f"\n## {size}: milliseconds a frame at levels {', '.join(map(str, sorted({cell['level'] for cell in figures['cells']})))}\n\n{table(figures, size)}"
    return text


def processor():
    """What the machine is, as far as it says."""
    told = subprocess.run([ROOT / "target/release/pdk", "--version"], capture_output=True, text=True, check=True).stdout
    instructions = next(line.removeprefix("instructions: ") for line in told.splitlines() if line.startswith("instructions: "))
    info = Path("/proc/cpuinfo")
    model = next((line.split(":")[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")), None) if info.exists() else None
    return f" ({model}, {instructions})" if model else f" ({instructions})"


def write(figures, options):
    # Without a measurement of the loop, its table stays as it is.
    loop = between_marks(PAGE.read_text()) if options.without_loop else closed_loop(figures)
    PAGE.write_text(page(figures, loop))


def between_marks(text):
    """The table of the loop in the page."""
    start, end = MARKS
    return text.split(start)[1].split(f"\n{end}")[0]


def with_loop(text, table):
    """The page with another table of the loop."""
    start, end = MARKS
    head, rest = text.split(start)
    return f"{head}{start}{table}\n{end}{rest.split(end)[1]}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    listed = lambda text: text.split(",")  # noqa: E731
    parser.add_argument("--only", type=listed, default=[], help="perturbations; all if it is left out")
    parser.add_argument("--levels", type=lambda text: [int(level) for level in text.split(",")], default=list(LEVELS))
    parser.add_argument("--sizes", type=listed, default=["320x240", "1280x720"])
    parser.add_argument("--published", help="a checkout of the published tool's repository")
    parser.add_argument("--json", help="where all figures go as JSON")
    parser.add_argument("--without-loop", action="store_true", help="leave out the loop, which is measured by the clock and needs a quiet machine")
    parser.add_argument("--only-loop", action="store_true", help="measure nothing but the loop")
    parser.add_argument("--write", action="store_true", help="write docs/speed.md, or with --only-loop the table in it")
    options = parser.parse_args()
    if options.write and (options.only or options.levels != list(LEVELS)):
        parser.error("--write needs every perturbation and every level: leave out --only and --levels")
    if options.only_loop:
        table = closed_loop(measure_loop())
        print(table)
        if options.write:
            PAGE.write_text(with_loop(PAGE.read_text(), table))
        return
    figures = measure(options)
    if options.json:
        Path(options.json).write_text(json.dumps(figures, indent=1))
    print("\n" + summary(figures) + "\n" + closed_loop(figures) + "\nWhere pdk is slower\n\n" + losses(figures))
    if options.write:
        write(figures, options)


if __name__ == "__main__":
    main()
