"""Files that once blocked, took all memory or ended in somebody else's error; each as found."""

import io
import json
import time

import numpy as np
import pytest
import scipy.io
import scipy.sparse

import robustpolish as rp
from tests import made_up
from tests.fuzz.files_corpus import MOTION, corpus

CORPUS = corpus()
MODEL = CORPUS["load/machine.toml"].decode()


def edited(kind, *way, value=None):
    """Return a saved file with another value at a place in it."""
    content = json.loads(CORPUS[f"load/{kind}.json"])
    node = content
    for key in way[:-1]:
        node = node[key]
    node[way[-1]] = value
    return json.dumps(content)


HUGE, DEEP = 10**400, "[" * 500 + "]" * 500
JSON = {
    "an integer of 401 digits": edited("plant", "system", "A", value=[[HUGE, 1], [0, -2]]),
    "the same for a number": edited("design", "elapsed", value=HUGE),
    "the same for a count": edited("plant", "measurements", value=HUGE),
    "a negative sampling time": edited("plant", "system", "dt", value=-1),
    "an infinite sampling time": edited("plant", "system", "dt", value="inf"),
    "a name twice": edited("plant", "system", "inputs", value=["u1", "u1"]),
    "a name with a dot": edited("plant", "system", "inputs", value=["a.b", "c"]),
    "an infinite entry": edited("plant", "system", "A", value=[["inf", 1.0], [0.0, -2.0]]),
    "half a character": edited("plant", "system", "states", value=["\ud800", "c"]),
    "an empty detail": edited("design", "details", value={"x": {}}),
    "a detail of no kind": edited("design", "details", value={"x": {"poem": 1}}),
    "a detail of no length": edited("design", "details", value={"x": {"element": []}}),
    "a history of numbers": edited("design", "history", value=[1, 2]),
    "a history that is a table": edited("design", "history", value={"x": {}}),
    "an entry of 1e308": edited("design", "plant", "system", "C", value=[[1e308], [0.0], [1.0]]),
    "one of the controller": edited("static", "controller", "D", value=[[-1e308]]),
    "one of a sampled design": edited(
        "sampled", "plant", "system", "A", value=[[-1e308, 1.0], [0.0, -2.0]]
    ),
    "growth beyond doubles": edited(
        "sampled", "plant", "system", "A", value=[[-1.0, 1.0], [4294967296, -2.0]]
    ),
    "a ledger of other outputs": edited("diagnosis", "ledger", 1, "nrmse", value={"y": 1.0}),
    "lists in lists": CORPUS["load/plant.json"].decode().replace("0.1", DEEP),
    "a number": "3",
    "a word": '"design"',
}  # fmt: skip
TOML = {
    "a number for places": MODEL.replace('of = ["x", "ground"]', "of = 5"),
    "an integer of 5000 digits": MODEL.replace("mass = 2.0", f"mass = {'9' * 5000}"),
    "an integer of 400 digits": MODEL.replace("mass = 2.0", f"mass = {'9' * 400}"),
    "lists in lists": MODEL.replace("mass = 2.0", f"mass = {DEEP}"),
}
OTHERS = {
    "a heap that never ends.h5": CORPUS["record/plain.h5"][:7360]
    + b"\0"
    + CORPUS["record/plain.h5"][7361:],
    "infinite among gaps.csv": b"time [s],x [m]\n0,1\n1,\n2,inf\n3,4\n4,1\n5,3\n",
    "two samples at almost the same time.csv": b"t [s],x [m]\n0,0\n"
    b"5e-324,1\n2,0\n3,1\n4,1\n5,3\n6,2\n7,1\n8,0\n",
    "no lines.uff": b"\n".join([*CORPUS["response/lines.uff"].split(b"\n")[:13], b"    -1\n"]),
}  # fmt: skip


def written(folder, name, content):
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("what", JSON)
def test_edited_results_are_refused(what, tmp_path):
    with pytest.raises(rp.InvalidInputError):
        rp.load(written(tmp_path, "a.json", JSON[what]))


@pytest.mark.parametrize("what", TOML)
def test_edited_models_are_refused(what, tmp_path):
    assert TOML[what] != MODEL
    with pytest.raises(rp.InvalidInputError):
        rp.MechanicalModel.from_toml(TOML[what])
    with pytest.raises(rp.InvalidInputError):
        rp.load(written(tmp_path, "a.toml", TOML[what]))


@pytest.mark.parametrize("what", OTHERS)
def test_damaged_records_are_refused(what, tmp_path):
    path = written(tmp_path, f"a.{what.rpartition('.')[2]}", OTHERS[what])
    read = rp.read_frequency_response if what == "no lines.uff" else rp.read_measurement
    with pytest.raises(rp.InvalidInputError):
        read(path)


def test_a_last_sample_long_after_the_others(tmp_path):
    """As many samples as the steps would have could not be held in memory."""
    rows = b"t [s],x [m]\n0,1\n1,2\n2,1\n3,2\n4,1\n2147483647,2\n"
    read = rp.read_measurement(written(tmp_path, "a.csv", rows))
    assert read.sizes["time"] == 6


def test_a_gain_without_entries(tmp_path):
    task = CORPUS["task/task.toml"].decode().replace("noise = 1e-9", "noise = [[]]")
    with pytest.raises(rp.InvalidInputError):
        rp.read_design_task(written(tmp_path, "a.toml", task))


def test_sparse_matrices_of_old_matlab_files_are_left_out(tmp_path):
    path = tmp_path / "a.mat"
    content = {"t": np.arange(24) / 1e3, "x": MOTION, "S": scipy.sparse.eye(3).tocsc()}
    scipy.io.savemat(path, content, format="4")
    assert list(rp.read_measurement(path)) == ["x"]


def test_empty_objects_of_matlab_files_are_left_out(tmp_path):
    """A cell without an array: SciPy returns None."""
    good = CORPUS["record/v5.mat"]
    bad = good[:994] + bytes(64) + good[1058:]
    content = scipy.io.loadmat(io.BytesIO(bad))
    assert content["s"].dtype == object
    assert content["s"].item() is None
    read = rp.read_measurement(written(tmp_path, "a.mat", bad))
    assert set(read) >= {"F", "x"}


def test_meshes_of_impossible_faces_and_sizes(tmp_path):
    good = CORPUS["mould/sheet.obj"].decode()
    for what, content in {
        "a corner that is not there": good.replace("f 1 ", "f 270 ", 1),
        "a size that has no square": good.replace("v 4", "v 4e200", 1),
        "a size without a square": "v 0 0 0\nv 1e-200 0 0\nv 0 1e-200 0\nf 1 2 3\nf 1 3 2\n",
    }.items():
        assert content != good, what
        with pytest.raises(rp.InvalidInputError):
            rp.polishing.Mould.from_stl(written(tmp_path, "a.obj", content), unit="m")


def test_times_of_a_path_that_are_almost_the_same(tmp_path):
    times = b"t,x,y\n0,0,0\n5e-324,1,0\n2,2,0\n1e308,3,0\n"
    with pytest.raises(rp.InvalidInputError, match="equal distance"):
        rp.polishing.ToolPath.from_csv(written(tmp_path, "a.csv", times))


def test_gains_without_a_square():
    for low, high in ((1e308, 0.5), (0.5, 1e308)):
        with pytest.raises(rp.InvalidInputError, match="a gain from 1e-100"):
            rp.weight(low, 1.0, high)


def test_a_long_head_is_read_in_linear_time(tmp_path):
    def seconds(count):
        content = "# remark, of the logger\n" * count + "time [s],x [m]\n0,1\n1,2\n2,5\n"
        path = written(tmp_path, "a.csv", content)
        start = time.process_time()
        assert rp.read_measurement(path)["x"].size == 3
        return time.process_time() - start

    seconds(10)
    # 25 s once; a hundred times the slowest machine's 0.4 s would still be quadratic here.
    assert seconds(400_000) < 8


def test_a_bomb_is_not_unpacked(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", t=np.zeros((2000, 80_000), dtype=np.int8), x=[1.0])
    with pytest.raises(rp.InvalidInputError, match="unpacked"):
        rp.read_measurement(tmp_path / "a.npz", max_bytes=1e8)
    assert made_up.model()  # the rest of the process has its memory
