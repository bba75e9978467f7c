"""Builds the wheel of a source distribution, for pip and other front ends: with `pdk-dist`, as maintainers do, for this machine."""

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "target" / "pdk-dist"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    if shutil.which("cargo") is None:
        raise SystemExit("pdk-perturb is compiled with Rust, and cargo is missing; install it from https://rustup.rs, or install a wheel")
    for old in OUT.glob("*.whl"):
        old.unlink()
    command = ["cargo", "run", "--release", "--locked", "-p", "pdk-dist", "--", "--profile", "release", "--no-package", "--wheel"]
    subprocess.run(command, cwd=ROOT, check=True)
    (wheel,) = OUT.glob("*.whl")
    shutil.copy(wheel, wheel_directory)
    return wheel.name


def build_sdist(sdist_directory, config_settings=None):
    raise SystemExit("a source distribution is not made from another one; run `cargo run --release -p pdk-dist -- --sdist` in a clone")
