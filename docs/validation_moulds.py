"""Figures of moulds, tool paths and force control for the validation page."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import robustpolish as rp

_HALF = 0.030  # m
_SIDE = (-_HALF, _HALF)
_FORMULA = "x**2/(2*0.05) + y**2/(2*0.08) + 3e-4*sin(x/0.009)*cos(y/0.011)"


def _height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return x**2 / 0.1 + y**2 / 0.16 + 3e-4 * np.sin(x / 0.009) * np.cos(y / 0.011)


def _slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return x / 0.05 + 3e-4 / 0.009 * np.cos(x / 0.009) * np.cos(y / 0.011)


def _bend(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 1 / 0.05 - 3e-4 / 0.009**2 * np.sin(x / 0.009) * np.cos(y / 0.011)


def _from_mesh() -> rp.polishing.Mould:
    """Return the mould of an STL file with corners 1 mm apart."""
    import trimesh

    side = np.linspace(*_SIDE, 61)
    x, y = np.meshgrid(side, side, indexing="ij")
    corners = 1e3 * np.stack([x, y, _height(x, y)], axis=-1).reshape(-1, 3)
    n = np.arange(side.size**2).reshape(x.shape)
    a, b, c, d = n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "mould.stl"
        trimesh.Trimesh(corners, faces, process=False).export(file)
        return rp.polishing.Mould.from_stl(file, unit="mm")


def geometry() -> str:
    """Return how close moulds come to surfaces that are known in closed form."""
    x, y = np.random.default_rng(0).uniform(-0.9 * _HALF, 0.9 * _HALF, (2, 2000))
    lines = [
        "| made from | height | slope | second derivative |",
        "|---|---:|---:|---:|",
    ]
    ways = {
        "an STL mesh, corners 1 mm apart": _from_mesh(),
        "the formula": rp.polishing.Mould.from_formula(_FORMULA, x=_SIDE, y=_SIDE),
    }
    for name, mould in ways.items():
        height = np.abs(mould.height(x, y) - _height(x, y)).max()
        slope = np.abs(mould.gradient(x, y)[0] - _slope(x, y)).max()
        bend = np.abs(mould.bends(x, y)[0] - _bend(x, y)).max()
        lines.append(f"| {name} | {1e9 * height:.2g} nm | {slope:.2g} | {bend:.2g} 1/m |")
    return "\n".join(lines)


def trough() -> str:
    """Return how far forces on a mould of the trough are from those on the trough."""
    bends = rp.polishing.Surface().curvatures
    mould = rp.polishing.Mould.from_formula(
        "0.5*a*x**2 + 0.5*b*y**2",
        x=(-0.01, 0.05),
        y=(-0.02, 0.02),
        parameters={"a": bends[0], "b": bends[1]},
    )
    told = []
    for run in (1, 4):
        wanted = rp.polishing.simulate_brush(run=run, duration=0.2)
        found = rp.polishing.simulate_brush(run=run, duration=0.2, surface=mould)
        gap = max(float(np.abs(found[f] - wanted[f]).max()) for f in ("F_x", "F_y", "F_z"))
        told.append(f"{gap:.1g} N in run {run}")
    return " and ".join(told)


def spiral() -> str:
    """Return what five seconds along a spiral on an STL mesh cost and take off."""
    mould = _from_mesh()
    path = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.016, 0.0025, speed=0.04, over=mould)
    rp.polishing.simulate_brush(duration=0.001, surface=mould, path=path)  # compiled code is loaded
    lines = [
        "| run | CPU time of 5 s [s] | mean F_z [N] | passes agree within "
        "| volume taken off [mm^3] | Preston's [mm^3] |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for run in (1, 4):
        start = time.process_time()
        signals = rp.polishing.simulate_brush(run=run, duration=5.0, surface=mould, path=path)
        spent = time.process_time() - start
        volume = 1e9 * float(rp.polishing.removal_map(signals, mould).sum()) * 5e-4**2
        way = float(signals["contact_force"].sum("point").mean()) * 5.0 * 100 * np.pi * 0.010
        lines.append(
            f"| {run} | {spent:.1f} | {float(signals['F_z'].mean()):.4f} "
            f"| {signals.attrs['impulse_error']:.1e} | {volume:.5f} | {1e9 * 1e-13 * way:.5f} |"
        )
    return "\n".join(lines)


def force_control() -> str:
    """Return what ways to control the force make of a mould that is not where it should be."""
    mould = rp.polishing.Mould.from_formula(_FORMULA, x=_SIDE, y=_SIDE)
    clamped = rp.polishing.Mould.from_formula(
        f"{_FORMULA} + slope*x + wave*sin(y/0.0015)",
        x=_SIDE,
        y=_SIDE,
        parameters={"slope": np.tan(np.radians(0.5)), "wave": 1e-4},
    )
    path = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.016, 0.0025, speed=0.04, over=mould)
    moments = np.arange(0.0, 6.0, 1 / 2000)
    axis = rp.polishing.PolishingAxis()
    ways = [
        rp.polishing.passive_stiffness(axis),
        rp.polishing.impedance_control(axis),
        rp.polishing.admittance_control(axis),
        rp.polishing.hinf_force_control(axis),
    ]
    lines = [
        "| control | force error, mould clamped askew | removal error | force error, mould unknown "
        "| removal error |",
        "|---|---:|---:|---:|---:|",
    ]
    tables = [
        rp.polishing.compare_force_control(
            ways, path, rp.polishing.height_deviation(clamped, told, path, moments), moments
        ).table
        for told in (mould, None)
    ]
    for way in ways:
        cells = [
            f"{100 * float(table[name].sel(control=way.name)):.2f} %"
            for table in tables
            for name in ("force_error", "removal_error")
        ]
        lines.append(f"| {way.name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def values() -> Iterator[tuple[str, str]]:
    """Yield what the template asks for, by name."""
    yield "mould_geometry", geometry()
    yield "mould_trough", trough()
    yield "mould_spiral", spiral()
    yield "force_control", force_control()
