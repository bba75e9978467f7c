"""Measures calls from Python: what a call costs besides the kernel's work, and how pdk's corruptions agree with imagecorruptions.

    python -m venv venv && venv/bin/pip install -r tests/speed/requirements.txt target/pdk-dist/pdk_perturb-*.whl
    venv/bin/python tests/speed/python.py              # prints tables in Markdown, as docs/python.md has them
    venv/bin/python tests/speed/python.py overhead     # or one of: overhead, suite

Everything runs on one thread, in one run. Times are medians of the thread's processor time a call, after the first few. What pdk takes
beside other libraries, at every level, is measured by compare.py.
"""

import importlib
import os
import platform
import statistics
import sys
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy  # noqa: E402

import pdk_perturb as pdk  # noqa: E402
from pdk_perturb.corruptions import corrupt, get_corruption_names  # noqa: E402

SIZES = {"320x240": (240, 320), "1280x720": (720, 1280)}
BUDGET = 0.15  # Seconds for a figure.
LONG = 500_000_000  # Nanoseconds; what takes longer is measured once.


def main():
    print(f"load {os.getloadavg()[0]:.2f}, {platform.machine()}, Python {platform.python_version()}, numpy {numpy.__version__}\n")
    frames = {name: picture(*size) for name, size in SIZES.items()}
    parts = sys.argv[1:] or ["overhead", "suite"]
    if "overhead" in parts:
        overhead(frames["320x240"])
    if "suite" in parts:
        suite(frames)


def picture(height, width):
    """A scene with sky, ground, edges and grain."""
    random = numpy.random.default_rng(1)
    y, x = numpy.mgrid[0:height, 0:width]
    ground = 90 + 40 * numpy.sin(x / 40) * (y / height)
    sky = 200 - 60 * y / height
    scene = numpy.where(y > height * 0.45, ground, sky)[..., None] * [0.9, 1.0, 1.1]
    scene[height // 3 : height // 2, width // 4 : width // 3] = (160, 40, 30)
    return (scene + random.normal(0, 4, scene.shape)).clip(0, 255).astype(numpy.uint8)


def median_ms(work):
    """Milliseconds of processor time a call; of the first one if that takes long."""
    before = time.thread_time_ns()
    work()
    first = time.thread_time_ns() - before
    if first > LONG:
        return first / 1e6
    work()
    times, until = [], time.perf_counter() + BUDGET
    while len(times) < 5 or (time.perf_counter() < until and len(times) < 2000):
        before = time.thread_time_ns()
        work()
        times.append(time.thread_time_ns() - before)
    return statistics.median(times) / 1e6


def overhead(frame):
    """What a call costs besides the work on pixels: the time for a frame of 2 x 2, where that work is next to nothing."""
    tiny = numpy.ascontiguousarray(frame[:2, :2])
    out = numpy.empty_like(tiny)
    sequence = pdk.Perturbation("contrast@2")
    ways = {
        'perturb(image, "contrast@2")': lambda: pdk.perturb(tiny, "contrast@2"),
        'perturb(image, "contrast@2", seed=7, out=out)': lambda: pdk.perturb(tiny, "contrast@2", seed=7, out=out),
        'perturb(image, "contrast", level=2, factor=1.3)': lambda: pdk.perturb(tiny, "contrast", level=2, factor=1.3),
        "sequence(image)": lambda: sequence(tiny),
        "sequence(image, out=out)": lambda: sequence(tiny, out=out),
    }
    print("| call | microseconds besides the kernel's own |\n|---|---:|")
    for name, work in ways.items():
        print(f"| `{name}` | {1000 * median_ms(work):.1f} |")
    print()


def suite(frames):
    """The corruptions of ImageNet-C at severity 3, and how far both agree."""
    try:
        published = corruptions()
    except ImportError:
        print("imagecorruptions is not installed\n")
        return
    print("| corruption | " + " | ".join(f"pdk {size} | imagecorruptions" for size in SIZES) + " | equal values | largest difference | means |")
    print("|---|" + "---:|" * (2 * len(SIZES) + 3))
    ratios = {size: [] for size in SIZES}
    for name in get_corruption_names("all"):
        cells = []
        for size, frame in frames.items():
            seeds = iter(range(10**9))
            ours = median_ms(lambda: corrupt(frame, 3, name, seed=next(seeds)))
            theirs = median_ms(lambda: published.corrupt(frame, 3, name))
            ratios[size].append(theirs / ours)
            cells += [f"{ours:.3f}", f"{theirs:.2f}"]
        frame = frames["320x240"]
        pairs = [(corrupt(frame, severity, name, seed=severity), published.corrupt(frame, severity, name)) for severity in range(1, 6)]
        again = published.corrupt(frame, 1, name)
        if numpy.array_equal(again, pairs[0][1]):
            differences = numpy.stack([numpy.abs(a.astype(int) - b) for a, b in pairs])
            cells += [f"{100 * (differences == 0).mean():.2f} %", f"{differences.max()}", ""]
        else:
            means = [f"{numpy.mean([pair[which].mean() for pair in pairs]):.1f}" for which in (0, 1)]
            cells += ["random", "", " and ".join(means)]
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    summary(ratios)


def corruptions():
    """imagecorruptions, with what it calls in the present releases of numpy and scikit-image."""
    import skimage.filters

    numpy.float_ = numpy.float64
    smooth = skimage.filters.gaussian

    def gaussian(image, *arguments, multichannel=False, **named):
        return smooth(image, *arguments, channel_axis=-1 if multichannel else None, **named)

    module = importlib.import_module("imagecorruptions")
    importlib.import_module("imagecorruptions.corruptions").gaussian = gaussian
    return module


def summary(ratios):
    for size, of_size in ratios.items():
        mean = statistics.geometric_mean(of_size)
        print(f"\n{size}: {mean:.1f} times as fast in the geometric mean, {min(of_size):.1f} to {max(of_size):.1f}", end="")
    print("\n")


if __name__ == "__main__":
    main()
