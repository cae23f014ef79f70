"""The arm in three dimensions: its shapes, the points of its task, the paths of tip and elbow."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import trimesh
import viser

from redres_ros.robot_model import RobotModel
from redres_ros.robots import Arm
from redres_ros.robots.kinematics import BASE, MovingJoint
from redres_ros.robots.urdf import Urdf, motion_of
from redres_ros.rotation import to_quaternion

FIXED = -1  # in place of a joint, for what no joint moves

_GREY = (0.6, 0.62, 0.65)


@dataclass(frozen=True)
class Shape:
    """A shape of a link.

    Args:
        joint: The index of the moving joint that carries it; FIXED for none.
        pose: In the frame of the link which that joint moves, or in the base's, (4, 4).
        kind: 'cylinder', 'sphere' or 'box'.
        size: Of a cylinder radius and length, of a sphere its radius, of a box three edges [m].
        colour: Red, green and blue, 0 to 1.
    """

    joint: int
    pose: np.ndarray
    kind: str
    size: tuple[float, ...]
    colour: tuple[float, ...]


def shapes_of(arm: Arm) -> list[Shape]:
    """The visual shapes of an arm. Raises FileError for a URDF that cannot be used."""
    urdf = Urdf.read(arm.description())
    colours = _colours(urdf)
    shapes = []
    for link, (joint, pose) in _carriers(urdf, arm).items():
        for visual in urdf.links[link].findall('visual'):
            at = pose @ urdf.placement(visual, f'link {link}')
            colour: tuple[float, ...] = _GREY
            material = visual.find('material')
            if material is not None:
                colour = colours.get(material.get('name', ''), _GREY)
            for kind, size in _sizes(urdf, visual.find('geometry'), link):
                shapes.append(Shape(joint, at, kind, size, colour))
    return shapes


def _carriers(urdf: Urdf, arm: Arm) -> dict[str, tuple[int, np.ndarray]]:
    """Each link's moving joint, and the link's pose (4, 4) in the frame that this joint moves."""
    moving = {joint.link: index for index, joint in enumerate(arm.kinematics().joints)}
    children = {joint.child for joint in urdf.joints}
    carriers = {link: (FIXED, np.eye(4)) for link in urdf.links if link not in children}
    waiting = list(carriers)
    while waiting:
        parent = waiting.pop()
        carrier, pose = carriers[parent]
        for joint in urdf.joints:
            if joint.parent != parent:
                continue
            if joint.child in moving:
                carriers[joint.child] = (moving[joint.child], np.eye(4))
            else:
                placement = urdf.placement(joint.element, f'joint {joint.name}')
                carriers[joint.child] = (carrier, pose @ placement)
            waiting.append(joint.child)
    return carriers


def _colours(urdf: Urdf) -> dict[str, tuple[float, ...]]:
    colours = {}
    for material in urdf.robot.iter('material'):
        colour = material.find('color')
        if colour is not None:
            name = material.get('name', '')
            rgba = urdf.numbers(colour, 'rgba', '0.6 0.62 0.65 1', f'material {name}')
            colours[name] = tuple(rgba[:3].tolist())
    return colours


def _sizes(urdf: Urdf, geometry: object, link: str) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Kind and size of what stands in a geometry element."""
    owner = f'a shape of link {link}'
    for element in geometry if geometry is not None else ():  # type: ignore[attr-defined]
        if element.tag == 'cylinder':
            radius = urdf.number(element, 'radius', '0', owner)
            yield 'cylinder', (radius, urdf.number(element, 'length', '0', owner))
        elif element.tag == 'sphere':
            yield 'sphere', (urdf.number(element, 'radius', '0', owner),)
        elif element.tag == 'box':
            yield 'box', tuple(urdf.numbers(element, 'size', '0 0 0', owner).tolist())


_BLACK = (30, 30, 34)
_BLUE = (31, 119, 180)
_RED = (214, 39, 40)
_STONE = (150, 153, 160)
_LINES = (205, 210, 216)
_WAYS = {'tip': _BLACK, 'elbow': _BLUE}
_POINT = 0.018  # [m] radius of a point of the task
_THICKNESS = 0.008  # [m] of a way
_TOOL = 0.011  # [m] radius of what leads from the last joint's shapes to the tip
_FLOOR = -0.3  # [m]; the paper's task leads the wrist below the base
_PEDESTAL = 0.1  # [m] radius
# As in the pictures of `redres reproduce`, for an arm that reaches 1 m.
_CAMERA = np.array((1.15, 0.65, 0.65))  # [m]
_LOOK_AT = np.array((-0.1, 0.0, 0.3))  # [m]
_FINENESS = 3  # of a sphere


class ArmScene:
    """Draws an arm into a page.

    Args:
        server: Of the page.
        model: The arm.
        points: Of its task, (P, 3) [m]; (0, 3) for none.
    """

    def __init__(self, server: viser.ViserServer, model: RobotModel, points: np.ndarray) -> None:
        self._scene = server.scene
        self._model = model
        self._kinematics = model.arm.kinematics()
        self._links: list[viser.FrameHandle] = []
        for joint in self._kinematics.joints:
            self._add_link(joint)
        for number, shape in enumerate(shapes_of(model.arm)):
            self._add_shape(shape, number)
        self._add_tool()
        self._add_surroundings()
        for number, point in enumerate(points):
            self._scene.add_icosphere(
                f'/task/point_{number}', _POINT, color=_RED, position=point, cast_shadow=False
            )
        server.initial_camera.position = model.reach * _CAMERA
        server.initial_camera.look_at = model.reach * _LOOK_AT

    def show(self, q: np.ndarray) -> None:
        """Move the arm to joint positions q (n,) [rad]."""
        for joint, link, value in zip(
            self._kinematics.joints, self._links, q.tolist(), strict=True
        ):
            motion = motion_of(joint.axis, value, is_prismatic=joint.is_prismatic)
            moved = joint.before @ motion
            # Every change is sent to every browser, so only what moves is set.
            if joint.is_prismatic:
                link.position = moved[:3, 3]
            else:
                link.wxyz = _wxyz(moved)

    def ways(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Positions of tip and elbow at q (n,) [rad], each (3,) [m]; an arm may have no elbow."""
        places = {'tip': self._model.tip(q)[0]}
        if self._model.arm.elbow_frame:
            places['elbow'] = self._model.position(q, self._model.elbow_frame)
        return places

    def trace(self, way: str, points: np.ndarray) -> None:
        """Draw the path of tip or elbow.

        Args:
            way: 'tip' or 'elbow'.
            points: (N, 3) [m].
        """
        if len(points) > 1:
            segments = np.stack((points[:-1], points[1:]), axis=1)  # (N - 1, 2, 3)
            self._scene.add_line_segments(
                f'/ways/{way}', segments, colors=_WAYS[way], thickness=_THICKNESS
            )

    def _add_link(self, joint: MovingJoint) -> None:
        """A frame within that of the link before it: a joint that turns changes one quaternion."""
        parent = '/arm' if joint.parent == BASE else self._links[joint.parent].name
        link = self._scene.add_frame(
            f'{parent}/{joint.name}',
            show_axes=False,
            wxyz=_wxyz(joint.before),
            position=joint.before[:3, 3],
        )
        self._links.append(link)

    def _add_shape(self, shape: Shape, number: int) -> None:
        parent = '/base'
        if shape.joint != FIXED:
            parent = self._links[shape.joint].name
        mesh = _mesh(shape.kind, shape.size)
        self._scene.add_mesh_simple(
            f'{parent}/shape_{number}',
            mesh.vertices,
            mesh.faces,
            color=_colour(shape.colour),
            wxyz=_wxyz(shape.pose),
            position=shape.pose[:3, 3],
        )

    def _add_tool(self) -> None:
        """A rod from the last link to a tip that lies away from it."""
        way = self._kinematics.tip[:3, 3]
        length = float(np.linalg.norm(way))
        if length < _TOOL:
            return
        mesh = trimesh.creation.cylinder(_TOOL, segment=np.stack((np.zeros(3), way)))
        self._scene.add_mesh_simple(
            f'{self._links[-1].name}/tool', mesh.vertices, mesh.faces, color=_STONE
        )

    def _add_surroundings(self) -> None:
        self._scene.world_axes.visible = False
        self._scene.add_grid(
            '/floor',
            width=3.0,
            height=3.0,
            position=(0.0, 0.0, _FLOOR),
            cell_size=0.25,
            section_size=1.0,
            cell_color=_LINES,
            section_color=_LINES,
        )
        mesh = trimesh.creation.cylinder(_PEDESTAL, segment=[(0.0, 0.0, _FLOOR), (0.0, 0.0, 0.0)])
        self._scene.add_mesh_simple('/base/pedestal', mesh.vertices, mesh.faces, color=_STONE)


def _mesh(kind: str, size: tuple[float, ...]) -> trimesh.Trimesh:
    if kind == 'cylinder':
        return trimesh.creation.cylinder(size[0], size[1], sections=40)
    if kind == 'sphere':
        return trimesh.creation.icosphere(_FINENESS, size[0])
    return trimesh.creation.box(size)


def _colour(colour: tuple[float, ...]) -> tuple[int, int, int]:
    red, green, blue = (round(255 * share) for share in colour)
    return red, green, blue


def _wxyz(pose: np.ndarray) -> np.ndarray:
    """The quaternion of a pose (4, 4), (4,), in viser's order."""
    x, y, z, w = to_quaternion(pose[:3, :3])
    return np.array((w, x, y, z))
