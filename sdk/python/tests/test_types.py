"""The examples of the documents pass `mypy --strict`. Skipped without mypy."""

import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import pdk_perturb as pdk

pytest.importorskip("mypy", reason="mypy is missing; `pip install mypy`")

REPOSITORY = Path(__file__).parents[3]

#: What the examples have from elsewhere: pictures, and packages that need not be installed.
AROUND = """\
from collections.abc import Callable, Iterable
from typing import Any

import numpy
from numpy.typing import NDArray

import pdk_perturb as pdk

image: NDArray[numpy.uint8]
record: pdk.Record
batch: NDArray[numpy.uint8]
frames: Iterable[NDArray[numpy.uint8]]
show: Callable[[NDArray[numpy.uint8]], None]
root: str
ImageFolder: Any
Compose: Any
ToTensor: Any
DataLoader: Any
"""


def examples():
    """The examples in Python of a document, each with the line on which it begins."""
    for name in ("docs/guide/perturb.md", "docs/python.md"):
        text = (REPOSITORY / name).read_text()
        for found in re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
            yield name, text[: found.start()].count("\n") + 1, found.group(1)


def check(files):
    # Packages that the examples import need not be installed.
    options = ["--strict", "--no-error-summary", "--disable-error-code", "import-not-found", "--cache-dir", "cache"]
    command = [sys.executable, "-m", "mypy", *options, *files]
    return subprocess.run(command, cwd=files[0].parent, capture_output=True, text=True)


def test_the_examples_in_the_documents_are_typed(tmp_path):
    files, functions = [], {}
    for document, line, code in examples():
        # One that begins with the name of its file is imported by others.
        if named := re.match(r"# (\w+\.py)\n", code):
            file, text = tmp_path / named[1], code
        else:
            # A function of its own, so that names may mean something else in the next example.
            file = tmp_path / f"example_{Path(document).stem.lower()}_{line}.py"
            text = AROUND + "\n\ndef example() -> None:\n" + textwrap.indent(code, "    ")
        file.write_text(text)
        functions[file.name] = f"{document}, line {line}"
        files.append(file)
    assert len(files) > 10
    checked = check(files)
    assert checked.returncode == 0, f"{checked.stdout}{checked.stderr}{functions}"


def test_what_is_wrong_is_found(tmp_path):
    wrong = tmp_path / "wrong.py"
    wrong.write_text("import pdk_perturb as pdk\nrecord: int = pdk.run('quickstart')\npdk.perturb(1, 2)\n")
    said = check([wrong]).stdout
    assert 'expression has type "Record"' in said and 'Argument 2 to "perturb"' in said, said
    assert Path(pdk.__file__).with_name("py.typed").is_file()
