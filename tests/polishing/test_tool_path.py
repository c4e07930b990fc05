"""Tool paths: speed, derivatives, distances, files."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.polishing.brush import tool_position, tool_velocity
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.tool_path import evaluate_path
from tests.polishing import moulds

SIDE = (-moulds.HALF, moulds.HALF)


@pytest.fixture(scope="module")
def mould():
    return rp.polishing.Mould.from_formula(moulds.FORMULA, x=SIDE, y=SIDE)


@pytest.fixture(scope="module")
def paths(mould):
    through = [(0, 0), (0.01, 0), (0.01, 0.01)]
    make, how = rp.polishing.ToolPath, {"speed": 0.04, "over": mould}
    return [
        make.raster((-0.015, 0.015), (-0.01, 0.01), 0.0025, **how),
        make.spiral((0.0, 0.0), 0.015, 0.0025, **how),
        make.contour_parallel(mould, 0.003, margin=0.0115, speed=0.04),
        make.through(through, **how),
    ]


def test_every_path_keeps_its_speed_along_the_mould(mould, paths):
    for path in paths:
        time = np.linspace(0.0, path.duration, 3001)
        x, y = path.position(time)
        u, v = path.velocity(time)
        p, q = mould.gradient(x, y)
        speed = np.sqrt(u**2 + v**2 + (p * u + q * v) ** 2)
        assert np.median(speed) == pytest.approx(0.04, rel=0.005), path.name
        assert np.mean(np.abs(speed / 0.04 - 1) > 0.05) < 0.03, path.name
        time, step = np.linspace(0.01, path.duration - 0.01, 500), 1e-6
        found = (path.position(time + step) - path.position(time - step)) / (2 * step)
        np.testing.assert_allclose(path.velocity(time), found, atol=1e-6)


def test_contours_keep_their_distance_from_the_edge(mould, paths):
    path = paths[2]
    away = mould.distance_to_edge(*path.position(np.linspace(0.0, path.duration, 4000)))
    assert away.min() > 0.0115 - 2e-4
    near_a_loop = np.abs((away - 0.0115 + 0.0015) % 0.003 - 0.0015) < 4e-4
    assert near_a_loop.mean() > 0.85  # the rest leads from loop to loop, or is a rounded corner


def test_a_spiral_is_one_and_compiled_code_follows_it():
    path = rp.polishing.ToolPath.spiral((0.01, 0.02), 0.012, 0.003, speed=0.04)
    x, y = path.position(np.linspace(0.0, path.duration, 2000))
    far = np.hypot(x - 0.01, y - 0.02)
    angle = np.unwrap(np.arctan2(y - 0.02, x - 0.01))
    np.testing.assert_allclose(far, 0.012 - 0.003 * angle / (2 * np.pi), atol=1e-5)
    path = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)
    place, velocity = np.zeros(3), np.zeros(3)
    for time in np.linspace(0.0, path.duration, 37):
        evaluate_path(time, path.packed, place, velocity)
        np.testing.assert_allclose(place[:2], path.position(time), atol=1e-15)
        np.testing.assert_allclose(velocity[:2], path.velocity(time), atol=1e-13)


def test_files_with_and_without_times(tmp_path):
    time = np.linspace(0.0, 2.0, 201)
    x, y = 10 * np.cos(time), 10 * np.sin(time)
    timed, bare = tmp_path / "timed.csv", tmp_path / "bare.csv"
    timed.write_text(
        "t,x,y\n" + "\n".join(f"{a},{b},{c}" for a, b, c in zip(time, x, y, strict=True))
    )
    bare.write_text("x, y\n0, 0\n10, 0\n10, 10\n")
    path = rp.polishing.ToolPath.from_csv(timed, unit="mm")
    assert path.duration == pytest.approx(2.0)
    wanted = 0.01 * np.array([np.cos(1.234), np.sin(1.234)])
    np.testing.assert_allclose(path.position(1.234), wanted, atol=1e-8)
    path = rp.polishing.ToolPath.from_csv(bare, unit="mm", speed=0.01)
    assert path.length == pytest.approx(0.02, rel=0.02)
    assert path.name == "bare.csv"


@pytest.mark.parametrize(
    ("text", "speed", "message"),
    [
        ("x,y\n0,0\n1,1\n", None, "speed"),
        ("t,x,y\n0,0,0\n1,1,1\n2,1,0\n3,0,0\n", 0.1, "speed"),
        ("t,x,y\n0,0,0\n1,1,1\n1,1,0\n3,0,0\n", None, "rising times"),
        ("a,b\n0,0\n", 0.1, "columns a, b"),
        ("x,y\n0,zero\n", 0.1, "numbers in every row"),
        ("x,y\n0,0\n0,0\n", 0.1, "at least two"),
    ],
)
def test_files_that_are_no_path_are_refused(tmp_path, text, speed, message):
    file = tmp_path / "path.csv"
    file.write_text(text)
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.polishing.ToolPath.from_csv(file, speed=speed)


def test_paths_are_checked(mould):
    make = rp.polishing.ToolPath
    with pytest.raises(rp.InvalidInputError, match="leaves the surface near x = 30"):
        make.through([(0, 0), (0.05, 0)], speed=0.04, over=mould)
    with pytest.raises(rp.InvalidInputError, match="from the edge"):
        make.contour_parallel(mould, 0.003, margin=0.04, speed=0.04)
    with pytest.raises(rp.InvalidInputError, match="pitch"):
        make.spiral((0, 0), 0.01, 0.1, speed=0.04)
    path = make.raster((0, 0.01), (0, 0.01), 0.005, speed=0.04)
    with pytest.raises(rp.InvalidInputError, match="where the path is"):
        path.position(path.duration + 1)
    with pytest.raises(rp.InvalidInputError, match="places"):
        make(np.zeros((3, 2)), 0.1)


def test_velocity_is_the_derivative_of_the_place() -> None:
    brush, time, step = BrushParameters(), np.linspace(0.0, 1.0, 11), 1e-6
    moved = tool_position(time + step, brush) - tool_position(time - step, brush)
    np.testing.assert_allclose(tool_velocity(time, brush), moved / (2 * step), rtol=0, atol=1e-9)
    start = [2 * brush.rotation_radius + brush.radius, 0.0]
    np.testing.assert_allclose(tool_position(0.0, brush), start)
