"""A controller as an FMU for co-simulation (FMI 2.0), compiled here."""

from __future__ import annotations

import math
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import uuid
import zipfile
from pathlib import Path

from robustpolish.base.atomic_writes import new_file
from robustpolish.base.versions import __version__
from robustpolish.errors import MissingDependencyError, SolverError
from robustpolish.implementation.export.c import CodeSpec, c_text, identifier, rendered, target


def _texts(spec: CodeSpec, name: str) -> tuple[str, str]:
    """Return modelDescription.xml, and the controller with the functions of FMI 2.0 around it."""
    core = c_text(spec, name, "double")
    signals = (*spec.measurements, *spec.controls)
    values = {
        "spec": spec,
        "name": name,
        "version": __version__,
        # The same controller has the same identity, wherever and whenever it is exported.
        "guid": f"{{{uuid.uuid5(uuid.NAMESPACE_URL, core)}}}",
        "signals": signals,
        "units": sorted({spec.units[n] for n in signals if spec.units.get(n)}),
        "ny": len(spec.measurements),
        "nu": len(spec.controls),
        "period": repr(float(spec.period)),
        "delay": repr(float(spec.delay)),
        "queue": math.floor(spec.delay / spec.period) + 3,
    }
    description = rendered("modelDescription.xml.jinja", **values)
    return description, core + rendered("fmu.c.jinja", **values)


_FLAGS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared")
_WORDS = {"linux": ("linux", "so"), "darwin": ("darwin", "dylib"), "win32": ("win", "dll")}


def write_fmu(
    spec: CodeSpec, path: str | os.PathLike[str], name: str, *, force: bool = False
) -> Path:
    """Write the FMU; see `SampledDesign.export_fmu`.

    Parameters
    ----------
    spec : CodeSpec
    path : path
        A folder, or a file that ends in ``.fmu``.
    name : str
    force : bool, optional

    Returns
    -------
    pathlib.Path

    Raises
    ------
    MissingDependencyError
        If there is no C compiler.
    SolverError
        If the compiler refuses the source, which a working one does not.
    """
    identifier(name)
    place = target(path, name, ".fmu")
    description, source = _texts(spec, name)
    with new_file(place, force, (".fmu",)) as draft, zipfile.ZipFile(draft, "w") as archive:
        _add(archive, "modelDescription.xml", description.encode())
        _add(archive, f"sources/{name}.c", source.encode())
        folder, suffix = _platform()
        _add(archive, f"binaries/{folder}/{name}.{suffix}", _compiled(source, name))
    return place


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    """Add a file with a fixed date, so that the same controller gives the same bytes."""
    entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content, zipfile.ZIP_DEFLATED)


def _platform() -> tuple[str, str]:
    word, suffix = _WORDS.get(sys.platform, ("linux", "so"))
    bits = "64" if sys.maxsize > 2**32 else "32"
    machine = platform.machine().lower()
    if word == "linux" and machine not in ("x86_64", "amd64", "i686", "i386"):
        return f"{machine}-linux", suffix  # as FMI 3.0 and most importers call it
    return word + bits, suffix


def _compiled(source: str, name: str) -> bytes:
    compiler = shutil.which(os.environ.get("CC") or "cc") or shutil.which("gcc")
    if compiler is None:
        raise MissingDependencyError(
            "path: there is no C compiler to build the FMU with. Install gcc or clang, or set CC; "
            "export_c needs none."
        )
    with tempfile.TemporaryDirectory() as folder:
        file, library = Path(folder, f"{name}.c"), Path(folder, f"{name}.bin")
        file.write_text(source, encoding="utf-8")
        command = [compiler, *_FLAGS, "-o", str(library), str(file), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            line = (done.stderr.strip().splitlines() or ["no message"])[0]
            raise SolverError(f"path: {compiler} refused the source: {line}. Try another CC.")
        return library.read_bytes()
