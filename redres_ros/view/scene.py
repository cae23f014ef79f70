"""The arm in three dimensions: its shapes, its task, the paths of tip and elbow, the walls."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
import trimesh
import viser

from redres_ros.limits.shapes import SPHERE, DrawnShape
from redres_ros.robot_model import RobotModel
from redres_ros.robots import Arm
from redres_ros.robots.kinematics import BASE, MovingJoint
from redres_ros.robots.urdf import Urdf, motion_of
from redres_ros.rotation import to_quaternion

_BLACK = (30, 30, 34)
_BLUE = (31, 119, 180)
_RED = (214, 39, 40)
_PALE_RED = (240, 170, 170)
_GREEN = (44, 160, 44)
_THIN = 0.002  # [m] of a plane
_INSIDE = 0.12  # opacity of what the arm stays in
_OUTSIDE = 0.2  # of what it stays out of
_GREY = (0.6, 0.62, 0.65)  # of a shape without a colour
_STONE = (150, 153, 160)
_LINES = (205, 210, 216)
_PATHS = {'tip': _BLACK, 'elbow': _BLUE}
_POINT = 0.018  # [m] radius of a point of the task
_THICKNESS = 0.008  # [m] of a path
_TOOL = 0.011  # [m] radius of what leads from the last joint's shapes to the tip
_FLOOR = -0.3  # [m]; the paper's task leads the wrist below the base
_PEDESTAL = 0.1  # [m] radius
# As in the pictures of `redres reproduce`, for an arm that reaches 1 m.
_CAMERA = np.array((1.15, 0.65, 0.65))  # [m]
_LOOK_AT = np.array((-0.1, 0.0, 0.3))  # [m]
_FINENESS = 3  # of a sphere


@dataclass(frozen=True)
class Shape:
    """A shape of a link.

    Args:
        joint: Index of the moving joint that carries it, or BASE.
        pose: In the frame that this joint moves, or in the base's, (4, 4).
        kind: 'cylinder', 'sphere' or 'box'.
        size: Of a cylinder radius and length, of a sphere its radius, of a box three edges [m].
        colour: Red, green and blue, 0 to 1.
    """

    joint: int
    pose: np.ndarray
    kind: str
    size: tuple[float, ...]
    colour: tuple[float, ...]


class ArmScene:
    """Draws an arm into a page.

    Args:
        server: Server of the page.
        model: The arm.
        points: Points of its task, (P, 3) [m]; (0, 3) for none.
    """

    def __init__(self, server: viser.ViserServer, model: RobotModel, points: np.ndarray) -> None:
        self._scene = server.scene
        self._model = model
        self._kinematics = model.arm.kinematics()
        self._links: list[viser.FrameHandle] = []
        self._walls: list[viser.SceneNodeHandle] = []
        self.meshes: list[tuple[str, viser.MeshHandle]] = []  # of links that move, by their names
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

    def traced(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Positions of tip and elbow at q (n,) [rad], each (3,) [m]; an arm may have no elbow."""
        places = {'tip': self._model.tip(q)[0]}
        if self._model.arm.elbow_frame:
            places['elbow'] = self._model.position(q, self._model.elbow_frame)
        return places

    def trace(self, name: str, points: np.ndarray) -> None:
        """Draw the path of tip or elbow.

        Args:
            name: 'tip' or 'elbow'.
            points: (N, 3) [m].
        """
        if len(points) > 1:
            segments = np.stack((points[:-1], points[1:]), axis=1)  # (N - 1, 2, 3)
            self._scene.add_line_segments(
                f'/paths/{name}', segments, colors=_PATHS[name], thickness=_THICKNESS
            )

    def show_walls(self, walls: Iterable[DrawnShape]) -> None:
        """Replace the drawn walls: what the arm stays in, stays out of, or touches."""
        for handle in self._walls:
            handle.remove()
        self._walls = [self._add_wall(number, wall) for number, wall in enumerate(walls)]

    def _add_wall(self, number: int, wall: DrawnShape) -> viser.SceneNodeHandle:
        x, y, z, w = wall.quaternion
        if wall.size[2] < _THIN:  # a grid, behind which the arm is seen
            return self._scene.add_grid(
                f'/walls/{number}',
                width=wall.size[0],
                height=wall.size[1],
                cell_size=0.1,
                section_size=0.5,
                cell_color=_LINES if wall.is_solid else _PALE_RED,
                section_color=_STONE if wall.is_solid else _RED,
                position=wall.centre,
                wxyz=(w, x, y, z),
            )
        kind = 'sphere' if wall.kind == SPHERE else 'box'
        size = (wall.size[0] / 2.0,) if wall.kind == SPHERE else tuple(wall.size)
        colour = _GREEN if wall.keeps_in else _RED
        mesh = _mesh(kind, size)
        return self._scene.add_mesh_simple(
            f'/walls/{number}',
            mesh.vertices,
            mesh.faces,
            color=_STONE if wall.is_solid else colour,
            opacity=_INSIDE if wall.keeps_in else _OUTSIDE,
            side='double',
            position=wall.centre,
            wxyz=(w, x, y, z),
            cast_shadow=False,
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
        if shape.joint != BASE:
            parent = self._links[shape.joint].name
        mesh = _mesh(shape.kind, shape.size)
        drawn = self._scene.add_mesh_simple(
            f'{parent}/shape_{number}',
            mesh.vertices,
            mesh.faces,
            color=np.array(shape.colour),
            wxyz=_wxyz(shape.pose),
            position=shape.pose[:3, 3],
        )
        if shape.joint != BASE:
            self.meshes.append((self._kinematics.joints[shape.joint].link, drawn))

    def _add_tool(self) -> None:
        """A rod from the last link to a tip that lies away from it."""
        offset = self._kinematics.tip[:3, 3]
        length = float(np.linalg.norm(offset))
        if length < _TOOL:
            return
        mesh = trimesh.creation.cylinder(_TOOL, segment=np.stack((np.zeros(3), offset)))
        drawn = self._scene.add_mesh_simple(
            f'{self._links[-1].name}/tool', mesh.vertices, mesh.faces, color=_STONE
        )
        self.meshes.append((self._model.arm.tip_frame, drawn))

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


def shapes_of(arm: Arm) -> list[Shape]:
    """The visual shapes of an arm. Raises FileError for a URDF that cannot be used."""
    urdf = Urdf.read(arm.description())
    colours = _colours(urdf)
    shapes = []
    for link, (joint, pose) in arm.kinematics().links.items():
        for visual in urdf.links[link].findall('visual'):
            at = pose @ urdf.placement(visual, f'link {link}')
            colour: tuple[float, ...] = _GREY
            material = visual.find('material')
            if material is not None:
                colour = colours.get(material.get('name', ''), _GREY)
            for kind, size in _sizes(urdf, visual.find('geometry'), link):
                shapes.append(Shape(joint, at, kind, size, colour))
    return shapes


def _colours(urdf: Urdf) -> dict[str, tuple[float, ...]]:
    colours = {}
    for material in urdf.robot.iter('material'):
        colour = material.find('color')
        if colour is not None:
            name = material.get('name', '')
            rgba = urdf.numbers(colour, 'rgba', '0.6 0.62 0.65 1', f'material {name}')
            colours[name] = tuple(rgba[:3].tolist())
    return colours


def _sizes(
    urdf: Urdf, geometry: Element | None, link: str
) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Kind and size of what stands in a geometry element."""
    owner = f'a shape of link {link}'
    for element in geometry if geometry is not None else ():
        if element.tag == 'cylinder':
            radius = urdf.number(element, 'radius', owner)
            yield 'cylinder', (radius, urdf.number(element, 'length', owner))
        elif element.tag == 'sphere':
            yield 'sphere', (urdf.number(element, 'radius', owner),)
        elif element.tag == 'box':
            yield 'box', tuple(urdf.numbers(element, 'size', '0 0 0', owner).tolist())


def _mesh(kind: str, size: tuple[float, ...]) -> trimesh.Trimesh:
    if kind == 'cylinder':
        return trimesh.creation.cylinder(size[0], size[1], sections=40)
    if kind == 'sphere':
        return trimesh.creation.icosphere(_FINENESS, size[0])
    return trimesh.creation.box(size)


def _wxyz(pose: np.ndarray) -> np.ndarray:
    """The quaternion of a pose (4, 4), (4,), in viser's order."""
    x, y, z, w = to_quaternion(pose[:3, :3])
    return np.array((w, x, y, z))
