"""A curved mould that is known in closed form, as a formula, an array and a mesh."""

import numpy as np

HALF = 0.030  # m
FORMULA = "x**2/(2*0.05) + y**2/(2*0.08) + 3e-4*sin(x/0.009)*cos(y/0.011)"


def height(x, y):
    return x**2 / 0.1 + y**2 / 0.16 + 3e-4 * np.sin(x / 0.009) * np.cos(y / 0.011)


def slope_x(x, y):
    return x / 0.05 + 3e-4 / 0.009 * np.cos(x / 0.009) * np.cos(y / 0.011)


def bend_x(x, y):
    return 1 / 0.05 - 3e-4 / 0.009**2 * np.sin(x / 0.009) * np.cos(y / 0.011)


def places(count=300, share=0.9):
    return np.random.default_rng(1).uniform(-share * HALF, share * HALF, (2, count))


def triangles(count=61, height_of=height, scale=1.0):
    """Vertices, shape (n, 3), and faces of a mesh of the mould, in m times the scale."""
    side = np.linspace(-HALF, HALF, count)
    x, y = np.meshgrid(side, side, indexing="ij")
    vertices = scale * np.stack([x, y, height_of(x, y)], axis=-1).reshape(-1, 3)
    number = np.arange(count**2).reshape(count, count)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    return vertices, faces


def write_stl(path, vertices, faces):
    import trimesh

    trimesh.Trimesh(vertices, faces, process=False).export(path)
    return path
