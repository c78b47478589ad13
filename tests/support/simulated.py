"""A small simulated world made by hand: a room, a table with a cup on it, a chair, a ball, and a box that is carried.

The room's inner corners are (-3, -2.5, 0) and (3, 2.5, 2.6). Nothing in here is random.
"""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.open3d_loader import load_open3d
from supermap_cli.geometry.se3 import make_transform, transform_points
from supermap_cli.simulation.world import Fixture, Material, Motion, Shape, SimulatedThing, Stay, World, join_shapes

START_NS = 1_700_000_000_000_000_000
SECOND_NS = 1_000_000_000
CUP_LEAVES_NS = START_NS + 60 * SECOND_NS
BOX_LEAVES_NS, BOX_ARRIVES_NS = START_NS + 2 * SECOND_NS, START_NS + 4 * SECOND_NS
BOX_FROM, BOX_TO = (-2.2, -1.0, 0.0), (-2.2, 1.0, 0.0)

WOOD = Material((150, 100, 60), "grain", 0.08, 0.3)
CLOTH = Material((40, 90, 160), "checks", 0.05, 0.3)
RED = Material((215, 50, 45))
CARDBOARD = Material((190, 150, 100), "print", 0.2, 0.5)

_FACES = np.array(
    [
        *[(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4)],
        *[(2, 3, 7), (2, 7, 6), (1, 2, 6), (1, 6, 5), (3, 0, 4), (3, 4, 7)],
    ]
)


def block(size: tuple[float, float, float], at: tuple[float, float, float], material: Material) -> Shape:
    """A cuboid; `at` is its foot's centre."""
    x, y, z = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float).T
    foot = np.column_stack([x, y, z]) * np.array([size[0] / 2, size[1] / 2, 0])
    vertices = np.concatenate([foot, foot + np.array([0, 0, size[2]])]) + at
    return Shape(vertices, _FACES, np.zeros(len(_FACES), int), (material,))


def ball(radius_m: float, material: Material, steps: int = 24) -> Shape:
    """A sphere of latitude and longitude that stands on its frame's origin."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, steps + 1)
    longitude = np.arange(2 * steps) * np.pi / steps
    lat, lon = np.meshgrid(latitude, longitude, indexing="ij")
    points = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), 1 + np.sin(lat)], axis=-1) * radius_m
    row, column = np.meshgrid(np.arange(steps), np.arange(2 * steps), indexing="ij")
    after = (column + 1) % (2 * steps)
    a, b, c, d = (i * 2 * steps + j for i, j in ((row, column), (row, after), (row + 1, after), (row + 1, column)))
    lower, upper = np.stack([a, b, c], axis=-1)[1:], np.stack([a, c, d], axis=-1)[:-1]
    triangles = np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])
    return Shape(points.reshape(-1, 3), triangles, np.zeros(len(triangles), int), (material,))


def _table() -> Shape:
    legs = [block((0.06, 0.06, 0.7), (x, y, 0), WOOD) for x in (-0.65, 0.65) for y in (-0.35, 0.35)]
    return join_shapes([*legs, block((1.4, 0.8, 0.04), (0, 0, 0.7), WOOD)])


def _chair() -> Shape:
    legs = [block((0.04, 0.04, 0.43), (x, y, 0), WOOD) for x in (-0.19, 0.19) for y in (-0.19, 0.19)]
    return join_shapes(
        [*legs, block((0.42, 0.42, 0.04), (0, 0, 0.43), CLOTH), block((0.42, 0.04, 0.45), (0, 0.19, 0.47), CLOTH)]
    )


def room_fixtures() -> tuple[Fixture, ...]:
    """Floor, ceiling and four walls, 0.2 m thick."""
    plaster, carpet = Material((210, 205, 195), "speckle", 0.1, 0.1), Material((120, 125, 130), "speckle", 0.03, 0.3)
    return (
        Fixture("floor", block((6.4, 5.4, 0.2), (0, 0, -0.2), carpet)),
        Fixture("ceiling", block((6.4, 5.4, 0.2), (0, 0, 2.6), plaster)),
        Fixture("wall", block((0.2, 5.0, 2.6), (-3.1, 0, 0), plaster)),
        Fixture("wall", block((0.2, 5.0, 2.6), (3.1, 0, 0), plaster)),
        Fixture("wall", block((6.4, 0.2, 2.6), (0, -2.6, 0), plaster)),
        Fixture("wall", block((6.4, 0.2, 2.6), (0, 2.6, 0), plaster)),
    )


def standing(x: float, y: float, z: float, yaw: float = 0.0) -> np.ndarray:
    """T_world_thing (4, 4) of a thing on its foot."""
    c, s = np.cos(yaw), np.sin(yaw)
    return make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [x, y, z])


def small_world() -> World:
    """The room, furnished. The cup is taken away at `CUP_LEAVES_NS`; the box is carried from `BOX_FROM` to `BOX_TO`."""
    box = block((0.4, 0.3, 0.3), (0, 0, 0), CARDBOARD)
    things = (
        SimulatedThing("table-1", "table", _table()),
        SimulatedThing("cup-1", "cup", block((0.08, 0.08, 0.1), (0, 0, 0), RED)),
        SimulatedThing("chair-1", "chair", _chair()),
        SimulatedThing("ball-1", "ball", ball(0.25, RED)),
        SimulatedThing("box-1", "box", box),
    )
    carried = np.stack([standing(*BOX_FROM), standing(*BOX_TO, yaw=np.pi / 2)])
    return World(
        room_fixtures(),
        things,
        (
            Stay("table-1", standing(0, 0, 0)),
            Stay("cup-1", standing(0.3, 0.1, 0.74), until_ns=CUP_LEAVES_NS, on="table-1"),
            Stay("chair-1", standing(0.2, 0.9, 0, 0.3)),
            Stay("ball-1", standing(2.2, -1.5, 0)),
            Stay("box-1", carried[0], until_ns=BOX_LEAVES_NS),
            Stay("box-1", carried[1], since_ns=BOX_ARRIVES_NS),
        ),
        (Motion("box-1", box, np.array([BOX_LEAVES_NS, BOX_ARRIVES_NS]), carried),),
    )


def looking(from_xyz: tuple[float, float, float], at_xyz: tuple[float, float, float]) -> np.ndarray:
    """T_world_camera (4, 4) of a camera, held level, that looks from one point at another."""
    z = np.subtract(at_xyz, from_xyz) / np.linalg.norm(np.subtract(at_xyz, from_xyz))
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    return make_transform(np.column_stack([x, np.cross(z, x), z]), from_xyz)


def distance_to_surfaces(world: World, points: np.ndarray, stamp_ns: int, thing: int | None = None) -> np.ndarray:
    """(n,) metres from points (n, 3) in the world to the nearest surface that stands at a time; of one thing alone if
    it is given as in `RayHits` (k = `world.things[k - 1]`). Measured by open3d on meshes placed here.
    """
    placed = [(0, fixture.shape, np.eye(4)) for fixture in world.fixtures]
    standing = (stay for stay in world.stays if stay.covers(stamp_ns))
    placed += [
        (world.index[stay.thing_id] + 1, world.thing(stay.thing_id).shape, stay.T_world_thing) for stay in standing
    ]
    o3d = load_open3d()
    surfaces = o3d.t.geometry.RaycastingScene()
    for k, shape, T in placed:
        if thing in {None, k}:
            vertices = transform_points(T, shape.vertices).astype(np.float32)
            surfaces.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(shape.triangles.astype(np.uint32)))
    return surfaces.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy()
