"""The command `pdk`: hands over to the executable of this package."""

import os
import sys
from pathlib import Path


def main():
    executable = Path(__file__).parent / "installation" / "bin" / "pdk"
    # For pools in Python, which this interpreter runs.
    os.environ.setdefault("PDK_PYTHON", sys.executable)
    try:
        os.execv(executable, [str(executable), *sys.argv[1:]])
    except OSError as error:
        # The file is there and its loader is not: the C library is another one. pip does not install the wheel there, but a copy may get there.
        if executable.is_file() and isinstance(error, FileNotFoundError):
            sys.exit(f"pdk: error: {executable} needs glibc, and this system has another C library; use a container with Debian")
        sys.exit(f"pdk: error: {executable} cannot be started ({error.strerror}); install the package pdk-perturb again")


if __name__ == "__main__":
    main()
