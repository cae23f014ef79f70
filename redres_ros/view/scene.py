"""The arm in three dimensions: its shapes, its task, the paths of tip and elbow, the walls."""

from collections.abc import Iterable
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import viser

from redres_ros.geometry import to_quaternion
from redres_ros.robot_model import RobotModel
from redres_ros.robots import Arm
from redres_ros.robots.kinematics import BASE
from redres_ros.robots.scene import SPHERE, DrawnShape
from redres_ros.types import JointPositions

_BLACK = (30, 30, 34)
_BLUE = (31, 119, 180)
_RED = (214, 39, 40)
_PALE_RED = (240, 170, 170)
_GREEN = (44, 160, 44)
_STONE = (150, 153, 160)
_LINES = (205, 210, 216)
_PATHS = {'tip': _BLACK, 'elbow': _BLUE}
_THIN = 0.002  # [m] of a plane
_INSIDE = 0.12  # opacity of what the arm stays in
_OUTSIDE = 0.2  # of what it stays out of
_POINT = 0.018  # [m] radius of a point of the task
_THICKNESS = 0.008  # [m] of a path
_TOOL = 0.022  # [m] thickness of what leads from the last joint's shapes to the tip
_FLOOR = -0.3  # [m]; the paper's task leads the wrist below the base
_PEDESTAL = 0.1  # [m] radius
# As in the pictures of `redres reproduce`, for an arm that reaches 1 m.
_CAMERA = np.array((1.15, 0.65, 0.65))  # [m]
_LOOK_AT = np.array((-0.1, 0.0, 0.3))  # [m]


class ArmScene:
    """Draws an arm and the points (P, 3) [m] of its task into a page."""

    def __init__(self, server: viser.ViserServer, model: RobotModel, points: np.ndarray) -> None:
        self._scene = server.scene
        self._model = model
        self._kinematics = model.arm.kinematics()
        self._data = self._kinematics.model.createData()
        self._links: list[viser.FrameHandle] = []
        self._walls: list[viser.SceneNodeHandle] = []
        for joint in self._kinematics.joints:
            # Within the frame of the link before it: a joint that turns changes one quaternion.
            parent = '/arm' if joint.parent == BASE else self._links[joint.parent].name
            self._links.append(self._scene.add_frame(f'{parent}/{joint.name}', show_axes=False))
        self.show(np.zeros(model.n))
        for shape in _shapes_of(model.arm):
            self._add_shape(shape)
        tool = (np.zeros(3), self._kinematics.tip[:3, 3])  # a tip may lie away from the last link
        self._add_path(f'{self._links[-1].name}/tool', np.array(tool), _STONE, _TOOL)
        self._add_surroundings()
        for number, point in enumerate(points):
            self._scene.add_icosphere(
                f'/task/point_{number}', _POINT, color=_RED, position=point, cast_shadow=False
            )
        server.initial_camera.position = model.reach * _CAMERA
        server.initial_camera.look_at = model.reach * _LOOK_AT

    def show(self, q: JointPositions) -> None:
        pin.forwardKinematics(self._kinematics.model, self._data, q)
        for link, placement in zip(self._links, self._data.liMi[1:], strict=True):
            pose = placement.homogeneous
            link.position = pose[:3, 3]
            link.wxyz = _wxyz(pose)

    def traced(self, q: JointPositions) -> dict[str, np.ndarray]:
        """Positions of tip and elbow, each (3,) [m]."""
        model = self._model
        return {'tip': model.tip(q)[0], 'elbow': model.position(q, model.elbow_frame)}

    def trace(self, name: str, points: np.ndarray) -> None:
        """Draw the path of 'tip' or 'elbow' through points (N, 3) [m]."""
        if len(points) > 1:
            self._add_path(f'/paths/{name}', points, _PATHS[name], _THICKNESS)

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
        colour = _GREEN if wall.keeps_in else _RED
        looks: dict[str, Any] = {
            'color': _STONE if wall.is_solid else colour,
            'opacity': _INSIDE if wall.keeps_in else _OUTSIDE,
            'side': 'double',
            'position': wall.centre,
            'wxyz': (w, x, y, z),
            'cast_shadow': False,
        }
        if wall.kind == SPHERE:
            return self._scene.add_icosphere(f'/walls/{number}', wall.size[0] / 2.0, **looks)
        return self._scene.add_box(f'/walls/{number}', dimensions=wall.size, **looks)

    def _add_shape(self, shape: pin.GeometryObject) -> None:
        joint = shape.parentJoint - 1
        parent = '/base' if joint == BASE else self._links[joint].name
        name = f'{parent}/{shape.name}'
        pose = shape.placement.homogeneous
        looks = {'color': shape.meshColor[:3], 'wxyz': _wxyz(pose), 'position': pose[:3, 3]}
        geometry = shape.geometry
        if isinstance(geometry, pin.hppfcl.Cylinder):
            self._scene.add_cylinder(name, geometry.radius, 2.0 * geometry.halfLength, **looks)
        elif isinstance(geometry, pin.hppfcl.Sphere):
            self._scene.add_icosphere(name, geometry.radius, **looks)
        else:
            self._scene.add_box(name, dimensions=2.0 * geometry.halfSide, **looks)

    def _add_path(
        self, name: str, points: np.ndarray, colour: tuple[int, int, int], thickness: float
    ) -> None:
        segments = np.stack((points[:-1], points[1:]), axis=1)  # (N - 1, 2, 3)
        self._scene.add_line_segments(name, segments, colors=colour, thickness=thickness)

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
        self._scene.add_cylinder(
            '/base/pedestal', _PEDESTAL, -_FLOOR, _STONE, position=(0.0, 0.0, _FLOOR / 2.0)
        )


def _shapes_of(arm: Arm) -> list[pin.GeometryObject]:
    """The cylinders, spheres and boxes that an arm is drawn by; files of meshes are left out."""
    robot = ElementTree.fromstring(arm.description())
    for link in robot.iter('link'):
        for visual in link.findall('visual'):
            if visual.find('geometry/mesh') is not None:
                link.remove(visual)
    text = ElementTree.tostring(robot, encoding='unicode')
    model = pin.buildModelFromXML(text)
    shapes = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL)
    return list(shapes.geometryObjects)


def _wxyz(pose: np.ndarray) -> np.ndarray:
    """The quaternion of a pose (4, 4), (4,), in viser's order."""
    return np.roll(to_quaternion(pose[:3, :3]), 1)
