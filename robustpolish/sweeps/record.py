"""The file of a sweep: a line per finished point, which a kill can only tear at the end."""

from __future__ import annotations

import json
import os
import zlib
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from robustpolish.sweeps.outcome import Outcome
from robustpolish.validation import described, invalid

FORMAT = "robustpolish sweep 1"


class Record:
    """Finished points, appended to a file as they come.

    Parameters
    ----------
    path : path
        The file; made if it does not exist, continued if it is of the same sweep.
    checksum : str
        Of function, points and seed.
    count : int
        Number of points.

    Notes
    -----
    The first line names format, checksum and count. Each line begins with the CRC-32 of the
    rest. A last line without its end, or with another CRC, was torn by a kill and is cut off.
    """

    def __init__(self, path: str | os.PathLike[str], checksum: str, count: int) -> None:
        self.path = Path(path)
        self._head = {"format": FORMAT, "checksum": checksum, "count": count}
        self.found = self._open()
        self._file: BinaryIO = self.path.open("ab")
        if not self.path.stat().st_size:
            self._write([self._head])

    def __enter__(self) -> Record:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.close()

    def add(self, finished: list[tuple[int, Outcome]]) -> None:
        """Append points; they are with the operating system when this returns."""
        self._write([{"point": i, **outcome.to_json()} for i, outcome in finished])

    def _write(self, entries: list[dict]) -> None:
        for entry in entries:
            text = json.dumps(entry).encode()
            self._file.write(b"%08x %s\n" % (zlib.crc32(text), text))
        self._file.flush()

    def _open(self) -> dict[int, Outcome]:
        """Return the points that the file holds, and cut off a torn end."""
        if not self.path.parent.is_dir():
            remedy = "Create the folder first."
            raise invalid("file", str(self.path), "a path in an existing folder", remedy)
        if not self.path.exists():
            return {}
        content = self.path.read_bytes()
        if self._begun(content):
            os.truncate(self.path, 0)
            return {}
        lines = content.splitlines(keepends=True)
        entries = [_entry(line) for line in lines]
        if entries[0] is None or entries[0].get("format") != FORMAT:
            raise self._refused("holds something else")
        if entries[0] != self._head:
            raise self._refused("holds another function, other points or another seed")
        if entries[-1] is None:
            os.truncate(self.path, len(content) - len(lines.pop()))
            entries.pop()
        if None in entries:
            raise self._refused(f"is damaged in line {entries.index(None) + 1}")
        return {entry["point"]: Outcome.from_json(entry) for entry in entries[1:] if entry}

    def _begun(self, content: bytes) -> bool:
        """Tell whether this is empty, or a first line of ours that was torn."""
        text = json.dumps(self._head).encode()
        return (b"%08x %s\n" % (zlib.crc32(text), text))[:-1].startswith(content)

    def _refused(self, why: str) -> Exception:
        remedy = f"Choose another file, or delete {self.path} to start anew."
        return invalid("file", described(f"one that {why}"), "a file of this sweep", remedy)


def _entry(line: bytes) -> dict | None:
    code, _, text = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or code != b"%08x" % zlib.crc32(text):
        return None
    return json.loads(text)
