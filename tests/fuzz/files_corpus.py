"""Small good files of every kind that the package reads, made by code: what is then damaged."""

from __future__ import annotations

import io
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import scipy.io

import robustpolish as rp
from tests import made_up
from tests.machine_files import machine

Corpus = dict[str, bytes]
"""Content by name; what stands before the first stroke of the name says who reads it."""

TIME = np.arange(24) / 1000
FORCE = 2.0 * np.sin(300 * TIME)
MOTION = 1e-3 * np.cos(200 * TIME)
_MACHINE = machine("every_part")
_TASK = machine("task")


def corpus() -> Corpus:
    """Return all of them; those that need a library which is not installed are left out."""
    made: Corpus = {}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        place = Path(folder)
        for make in (_saved, _models, _tables, _binary, _extras, _moulds):
            make(made, place)
    return made


def _by_path(folder: Path, name: str, write: Callable[[Path], object]) -> bytes:
    path = folder / name
    write(path)
    return path.read_bytes()


def _saved(made: Corpus, folder: Path) -> None:
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0, 1.0], [0.0, -2.0]], [[1.0], [0.5]], [[0.0], [1.0]], [[1.0, 0.0]], [[1.0, 0.0]],
        D11=[[0.1]],
    )  # fmt: skip
    full = rp.GeneralizedPlant.from_matrices(
        [[-1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]],
        D12=[[0.0], [0.5]], D21=[[0.0, 0.1]],
    )  # fmt: skip
    static = rp.given_controller(plant, [[-0.5]])
    design = rp.output_feedback(full)
    results = {
        "plant": plant,
        "wired": rp.read_design_task(_TASK).plant,
        "static": static,
        "design": design,
        "discrete": rp.given_controller(
            rp.GeneralizedPlant.from_matrices([[0.5]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], dt=0.05),
            [[-0.1]],
        ),
        "sampled": static.discretize(0.1, delay=0.05),
        "diagnosis": made_up.diagnosis(),
    }
    for name, result in results.items():
        made[f"load/{name}.json"] = _by_path(folder, f"{name}.json", result.save)


def _models(made: Corpus, folder: Path) -> None:
    del folder
    made["load/machine.toml"] = _MACHINE.encode()
    made["load/written.toml"] = made_up.model().to_toml().encode()
    made["task/task.toml"] = _TASK.encode()


def _table(columns: list[np.ndarray], head: str, separator: str = ",", comma: bool = False) -> str:
    rows = [separator.join(f"{value:.6g}" for value in row) for row in zip(*columns, strict=True)]
    text = "\n".join(rows)
    return head + (text.replace(".", ",") if comma else text) + "\n"


def _tables(made: Corpus, folder: Path) -> None:
    del folder
    columns = [1e3 * TIME, FORCE, MOTION]
    made["record/plain.csv"] = _table(columns, "time [ms],F [N],x [mm]\n").encode()
    made["record/comma.txt"] = _table(
        columns, "# Logger 3\nAbtastrate: 1 kHz\nZeit;F;x\n(ms);(N);(mm)\n", ";", comma=True
    ).encode("utf-16")
    made["record/tabs.lvm"] = _table(
        columns, "LabVIEW Measurement\nDelta_X\t0.001\n***End***\nX_Value\tF\tx\n", "\t"
    ).encode("latin-1")
    stamps = [f'"2024-05-03T12:00:00.{i:03d}",{v:.4g},-,ok' for i, v in enumerate(FORCE)]
    made["record/stamps.csv"] = ("time,F [N],y,state\r\n" + "\r\n".join(stamps)).encode()
    frequency = np.linspace(1.0, 20.0, 12)
    response = [frequency, 1 / frequency, -0.1 * frequency, np.full(12, 0.9)]
    head = "frequency [Hz],x/F real [m/N],x/F imag [m/N],x/F coherence\n"
    made["response/response.csv"] = _table(response, head).encode()


def _binary(made: Corpus, folder: Path) -> None:
    arrays = {"t": TIME, "F": FORCE, "x": MOTION, "fs": 1000.0}
    cells = np.empty((2, 1), dtype=object)
    cells[0, 0], cells[1, 0] = MOTION, "text"
    rich = {**arrays, "s": {"a": MOTION, "b": "words"}, "c": cells, "m": np.stack([TIME, FORCE]).T}
    for name, values, options in (
        ("v4", arrays, {"format": "4"}),
        ("v5", rich, {}),
        ("v7", rich, {"do_compression": True}),
    ):
        buffer = io.BytesIO()
        scipy.io.savemat(buffer, values, **options)
        made[f"record/{name}.mat"] = buffer.getvalue()
    for name, save in (("plain", np.savez), ("packed", np.savez_compressed)):
        buffer = io.BytesIO()
        save(buffer, **arrays, names=np.array(["a", "b"]))
        made[f"record/{name}.npz"] = buffer.getvalue()
    buffer = io.BytesIO()
    scipy.io.wavfile.write(buffer, 1000, np.stack([FORCE, MOTION]).T.astype(np.float32))
    made["record/float.wav"] = buffer.getvalue()
    buffer = io.BytesIO()
    scipy.io.wavfile.write(buffer, 1000, (1e4 * FORCE).astype(np.int16))
    made["record/integers.wav"] = buffer.getvalue()
    made["record/plain.h5"] = _by_path(folder, "plain.h5", _write_hdf5)


def _write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["t"], file["run/F"] = TIME, FORCE
        file.create_dataset("run/x", data=MOTION, chunks=(8,), compression="gzip")
        file["run/x"].attrs["units"] = "mm"
        file["names"] = ["a", "b"]
        file["run/refs"] = np.array([file["t"].ref, file["run/F"].ref], dtype=h5py.ref_dtype)
        file.attrs["fs"] = 1000.0


def _extras(made: Corpus, folder: Path) -> None:
    try:
        import nptdms
        import pyuff
    except ImportError:
        return

    def write_tdms(path: Path) -> None:
        with nptdms.TdmsWriter(path) as writer:
            facts = {"wf_increment": 1e-3, "unit_string": "mm"}
            writer.write_segment([nptdms.ChannelObject("g", "x", MOTION, facts)])

    made["record/plain.tdms"] = _by_path(folder, "plain.tdms", write_tdms)
    line = np.linspace(1.0, 20.0, 12)
    time = {"func_type": 1, "data": MOTION, "x": TIME, "ordinate_axis_units_lab": "mm"}
    response = {"func_type": 4, "data": 1 / (1 + 1j * line), "x": line}
    response["orddenom_axis_units_lab"] = "N"
    for name, item in (("record/time", time), ("response/lines", response)):
        entry = {
            "type": 58, "binary": 0, "id1": "x", "rsp_node": 1, "rsp_dir": 1, "ref_node": 2,
            "ref_dir": 3, "abscissa_spacing": 1, "orddenom_spec_data_type": 0,
            "ordinate_axis_units_lab": "m", **item,
        }  # fmt: skip

        def write_uff(path: Path, entry: dict = entry) -> None:
            pyuff.UFF(str(path)).write_sets([entry], mode="overwrite")

        made[f"{name}.uff"] = _by_path(folder, f"{name.split('/')[1]}.uff", write_uff)
    head = made["record/time.uff"].split(b"\n")[:13]
    head[1] = b"    58b     1     2          11         192     0     0           0           0"
    made["record/binary.uff"] = b"\n".join([*head, MOTION.tobytes() + b"\n    -1\n"])


def _moulds(made: Corpus, folder: Path) -> None:
    import trimesh

    side = np.arange(5.0)
    rows = ["x/y," + ",".join(f"{y:g}" for y in side)]
    rows += [f"{x:g}," + ",".join(f"{0.1 * x * x + 0.05 * y:g}" for y in side) for x in side]
    made["mould/heights.csv"] = ("\n".join(rows) + "\n").encode()
    made["path/places.csv"] = b"x,y\n0,0\n10,0\n10,10\n0,10\n"
    made["path/times.csv"] = b"t,x,y\n0,0,0\n0.1,1,0\n0.2,2,0.5\n0.3,3,1\n0.4,4,1\n"
    x, y = (a.ravel() for a in np.meshgrid(side, side, indexing="ij"))
    number = np.arange(25).reshape(5, 5)
    a, b, c, d = (number[i : 4 + i, j : 4 + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    sheet = trimesh.Trimesh(np.stack([x, y, 0.05 * x * x], -1), faces, process=False)
    for suffix, kind in (("stl", "stl"), ("ply", "ply"), ("obj", "obj"), ("off", "off")):
        content = sheet.export(file_type=kind)
        made[f"mould/sheet.{suffix}"] = content.encode() if isinstance(content, str) else content
    made["mould/text.stl"] = str(sheet.export(file_type="stl_ascii")).encode()
