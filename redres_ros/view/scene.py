"""The arm in three dimensions: its shapes, its task, the paths of tip and elbow, the walls; and a
recorded motion as a page that replays it, in any browser and without a server.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import trimesh
import viser

from redres_ros.files.text import writing
from redres_ros.geometry import to_quaternion
from redres_ros.limits.scene import SPHERE, DrawnShape
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.robots import Arm
from redres_ros.robots.kinematics import BASE, MovingJoint
from redres_ros.simulation.recording import Recording
from redres_ros.types import JointPositions
from redres_ros.view.server import CONTENT_POLICY, close_server, open_server

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
_TOOL = 0.011  # [m] radius of what leads from the last joint's shapes to the tip
_FLOOR = -0.3  # [m]; the paper's task leads the wrist below the base
_PEDESTAL = 0.1  # [m] radius
# As in the pictures of `redres reproduce`, for an arm that reaches 1 m.
_CAMERA = np.array((1.15, 0.65, 0.65))  # [m]
_LOOK_AT = np.array((-0.1, 0.0, 0.3))  # [m]
_RATE = 20.0  # pictures of a replayed motion, a second
_TRACED = 4  # pictures from one drawing of the paths to the next
_LAST = 1.5  # [s] for which the last picture stays
_LABEL = np.array((0.0, 0.0, 1.25))  # position of the title, for an arm that reaches 1 m


class ArmScene:
    """Draws an arm and the points (P, 3) [m] of its task into a page.

    Attributes:
        meshes: Of the moving links, with the links' names.
    """

    def __init__(self, server: viser.ViserServer, model: RobotModel, points: np.ndarray) -> None:
        self._scene = server.scene
        self._model = model
        self._kinematics = model.arm.kinematics()
        self._data = self._kinematics.model.createData()
        self._links: list[viser.FrameHandle] = []
        self._walls: list[viser.SceneNodeHandle] = []
        self.meshes: list[tuple[str, viser.MeshHandle]] = []
        for joint in self._kinematics.joints:
            self._add_link(joint)
        for shape in _shapes_of(model.arm):
            self._add_shape(shape)
        self._add_tool()
        self._add_surroundings()
        for number, point in enumerate(points):
            self._scene.add_icosphere(
                f'/task/point_{number}', _POINT, color=_RED, position=point, cast_shadow=False
            )
        server.initial_camera.position = model.reach * _CAMERA
        server.initial_camera.look_at = model.reach * _LOOK_AT

    def show(self, q: JointPositions) -> None:
        """Move the arm."""
        pin.forwardKinematics(self._kinematics.model, self._data, q)
        poses = [placement.homogeneous for placement in self._data.liMi[1:]]
        for joint, link, pose in zip(self._kinematics.joints, self._links, poses, strict=True):
            # Every change is sent to every browser, so only what moves is set.
            if joint.is_prismatic:
                link.position = pose[:3, 3]
            else:
                link.wxyz = _wxyz(pose)

    def traced(self, q: JointPositions) -> dict[str, np.ndarray]:
        """Positions of tip and elbow, each (3,) [m]; an arm may have no elbow."""
        places = {'tip': self._model.tip(q)[0]}
        if self._model.arm.elbow_frame:
            places['elbow'] = self._model.position(q, self._model.elbow_frame)
        return places

    def trace(self, name: str, points: np.ndarray) -> None:
        """Draw the path of 'tip' or 'elbow' through points (N, 3) [m]."""
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
        mesh = trimesh.creation.box(wall.size)
        if wall.kind == SPHERE:
            mesh = trimesh.creation.icosphere(radius=wall.size[0] / 2.0)
        colour = _GREEN if wall.keeps_in else _RED
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

    def _add_shape(self, shape: pin.GeometryObject) -> None:
        joint = shape.parentJoint - 1
        parent = '/base' if joint == BASE else self._links[joint].name
        mesh = _mesh(shape.geometry)
        pose = shape.placement.homogeneous
        drawn = self._scene.add_mesh_simple(
            f'{parent}/{shape.name}',
            mesh.vertices,
            mesh.faces,
            color=shape.meshColor[:3],
            wxyz=_wxyz(pose),
            position=pose[:3, 3],
        )
        if joint != BASE:
            self.meshes.append((self._kinematics.joints[joint].link, drawn))

    def _add_tool(self) -> None:
        """A rod from the last link to a tip that lies away from it."""
        offset = self._kinematics.tip[:3, 3]
        if float(np.linalg.norm(offset)) < _TOOL:
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


def _mesh(geometry: Any) -> trimesh.Trimesh:
    if isinstance(geometry, pin.hppfcl.Cylinder):
        return trimesh.creation.cylinder(geometry.radius, 2.0 * geometry.halfLength, sections=40)
    if isinstance(geometry, pin.hppfcl.Sphere):
        return trimesh.creation.icosphere(radius=geometry.radius)
    return trimesh.creation.box(2.0 * geometry.halfSide)


def _wxyz(pose: np.ndarray) -> np.ndarray:
    """The quaternion of a pose (4, 4), (4,), in viser's order."""
    return np.roll(to_quaternion(pose[:3, :3]), 1)


def write_page(
    recording: Recording, model: RobotModel, task: WaypointTask, title: str, path: Path
) -> None:
    """Write a page that replays a recording of at least one row. Raises FileError."""
    server = open_server(0, 'redres')
    try:
        scene = ArmScene(server, model, task.waypoints)
        server.scene.add_label('/title', title, position=model.reach * _LABEL)
        serializer = server.get_scene_serializer()
        t = recording['t']
        times = np.arange(t[0], t[-1] + 0.5 / _RATE, 1.0 / _RATE)
        paths: dict[str, list[np.ndarray]] = {}
        for number, q in enumerate(recording.vectors('q1')[recording.rows_at(times)]):
            scene.show(q)
            for name, place in scene.traced(q).items():
                paths.setdefault(name, []).append(place)
                if number % _TRACED == 0:
                    scene.trace(name, np.array(paths[name]))
            serializer.insert_sleep(1.0 / _RATE)
        serializer.insert_sleep(_LAST)
        page = serializer.as_html()
    finally:
        close_server(server)
    policy = CONTENT_POLICY.format(connect='')  # the browser loads nothing else
    rule = f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
    with writing(path):
        path.write_text(page.replace('<head>', f'<head>{rule}', 1), encoding='utf-8')
