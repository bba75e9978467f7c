"""Files that travel to other machines by their content: what a worker lacks, it gets once."""

import hashlib
import io
import os
import shutil
import tarfile
import tempfile
from pathlib import Path

from pdk_perturb._program import error

#: More than this is for shared storage, in bytes.
LARGEST = 2 << 30


def cache():
    """The folder in which what came from elsewhere is kept."""
    base = os.environ.get("PDK_CACHE") or os.path.join(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "pdk")
    return Path(base) / "travelled"


class Sender:
    """What travels from this machine. `put(bytes)` hands bytes over, and returns what stands for them."""

    def __init__(self, put):
        self._put = put
        #: What was handed over, by its hash.
        self.sent = {}
        self._known = {}

    def take(self, path):
        """A file or folder as messages describe it: its name, its hash, and whether it is a folder. `None` if there is none."""
        path = os.path.abspath(path)
        if os.path.isfile(path):
            status = os.stat(path)
            key = (path, status.st_size, status.st_mtime_ns)
            if key not in self._known:
                self._known[key] = self._send(path, Path(path).read_bytes() if status.st_size <= LARGEST else None)
            return {"name": os.path.basename(path), "hash": self._known[key], "folder": False}
        if os.path.isdir(path):
            if path not in self._known:
                self._known[path] = self._send(path, _packed(path))
            return {"name": os.path.basename(path), "hash": self._known[path], "folder": True}
        return None

    def _send(self, path, content):
        if content is None:
            raise error(
                "configuration",
                f"{path} has more than {LARGEST >> 30} GiB, which is too much to send to other machines; put it on storage that all of "
                "them have at the same path, and use `--pool 'ray --shared'`",
            )
        name = hashlib.sha256(content).hexdigest()
        if name not in self.sent:
            self.sent[name] = self._put(content)
        return name


def _packed(folder):
    """A folder as one file, whose bytes follow from names and contents alone; `None` if it is too large."""
    files = sorted(path for path in Path(folder).rglob("*") if path.is_file())
    if sum(path.stat().st_size for path in files) > LARGEST:
        return None
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive:
        for path in files:
            entry = tarfile.TarInfo(str(path.relative_to(folder)))
            entry.size = path.stat().st_size
            with path.open("rb") as content:
                archive.addfile(entry, content)
    return packed.getvalue()


def place(told, get):
    """The path of what was told by `Sender.take` on this machine. `get(hash)` gets its bytes, if it is not here yet."""
    folder = cache() / told["hash"][:32]
    path = folder / told["name"]
    if path.exists():
        return str(path)
    folder.mkdir(parents=True, exist_ok=True)
    # Others may be doing the same at this moment: the first one counts.
    part = Path(tempfile.mkdtemp(dir=folder, prefix=".part-"))
    made = part / told["name"]
    try:
        if told["folder"]:
            made.mkdir()
            with tarfile.open(fileobj=io.BytesIO(get(told["hash"]))) as archive:
                for entry in archive:
                    target = made / entry.name
                    target.parent.mkdir(parents=True, exist_ok=True)
                    target.write_bytes(archive.extractfile(entry).read())
        else:
            made.write_bytes(get(told["hash"]))
        os.rename(made, path)
    except OSError:
        if not path.exists():
            raise
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return str(path)
