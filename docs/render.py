"""Pictures of an arm, rendered by MuJoCo off screen; for the scripts beside it."""

import os
from collections.abc import Iterable
from itertools import pairwise

import numpy as np

os.environ.setdefault('MUJOCO_GL', 'egl')  # needs no display

import mujoco

from redres_ros import Recording, RobotModel, WaypointTask

# Where the camera looks [deg]: from the base frame's x towards y, and from the horizontal.
AZIMUTH = 28.0
ELEVATION = -14.0

_SIZE = 480, 600  # width and height [pixels]
_LOOK_AT = (-0.2, 0.0, 0.49)  # [m]
_DISTANCE = 2.12  # [m]
_FLOOR = -0.3  # [m]; below the base, because the paper's task leads the wrist there
_SPARE = 100  # shapes that MuJoCo may add of its own, such as lights and frames
_BLACK = (0.05, 0.05, 0.05, 1.0)
_BLUE = (0.12, 0.47, 0.71, 1.0)
_RED = (0.84, 0.15, 0.16, 1.0)
_VIOLET = (0.56, 0.40, 0.72, 1.0)  # of the tool, which no path has
_LINE = 0.007  # radius [m]
_PATH = 200  # points of a path at most
_POINT = 0.022  # radius [m]


def render(
    model: RobotModel, recording: Recording, task: WaypointTask, ticks: np.ndarray
) -> np.ndarray:
    """The arm at these ticks (N,) of a motion, with the paths of tip and elbow up to there and the
    points of the task, (N, height, width, 3) uint8.
    """
    q = recording.vectors('q1')
    rows = np.linspace(0, len(q) - 1, min(_PATH, len(q))).astype(int)
    paths = [(recording.vectors('x')[rows], _BLACK)]
    if model.arm.elbow_frame:
        elbow = np.array([model.position(q[row], model.arm.elbow_frame) for row in rows])
        paths.append((elbow, _BLUE))
    scene = _scene(model.arm.description(), model.arm.tip_frame)
    data = mujoco.MjData(scene)
    width, height = _SIZE
    drawn = scene.ngeom + 2 * len(rows) + len(task.waypoints)
    pictures = []
    with mujoco.Renderer(scene, height, width, max_geom=_SPARE + drawn) as renderer:
        for tick in ticks:
            data.qpos[:] = q[tick]
            mujoco.mj_forward(scene, data)
            renderer.update_scene(data, _camera())
            for path, colour in paths:
                for start, end in pairwise(path[: round(tick / (len(q) - 1) * len(path))]):
                    line = _add_shape(renderer.scene, 'CAPSULE', _LINE, start, colour)
                    mujoco.mjv_connector(line, line.type, _LINE, start, end)
            for point in task.waypoints:
                _add_shape(renderer.scene, 'SPHERE', _POINT, point, _RED)
            pictures.append(renderer.render().copy())
    return np.array(pictures)


def _add_shape(
    scene: mujoco.MjvScene, shape: str, radius: float, place: np.ndarray, colour: Iterable[float]
) -> mujoco.MjvGeom:
    """A shape of this picture alone, without a shadow."""
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(
        geom,
        getattr(mujoco.mjtGeom, f'mjGEOM_{shape}'),
        np.full(3, radius),
        place,
        np.eye(3).ravel(),
        np.array(colour, dtype=np.float32),
    )
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    scene.ngeom += 1
    return geom


def _camera() -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat[:] = _LOOK_AT
    camera.distance = _DISTANCE
    camera.azimuth = AZIMUTH
    camera.elevation = ELEVATION
    return camera


def _scene(urdf: str, tip_frame: str) -> mujoco.MjModel:
    """The arm with the shapes of its URDF, with a tool at its tip, on a pedestal, in the light."""
    spec = mujoco.MjSpec.from_string(urdf)
    spec.add_material(name='paint', specular=0.5, shininess=0.6)
    for geom in spec.geoms:
        geom.material = 'paint'
    _add_tool(spec.body(tip_frame))
    _add_floor(spec)
    _add_lights(spec)
    spec.stat.extent = 1.4
    spec.stat.center = _LOOK_AT
    visual = spec.visual
    visual.global_.offwidth, visual.global_.offheight = _SIZE
    visual.quality.offsamples = 8
    visual.quality.shadowsize = 4096
    return spec.compile()


def _add_tool(tip: mujoco.MjsBody) -> None:
    if np.linalg.norm(tip.pos) > 1e-3:
        tip.parent.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=(0.0, 0.0, 0.0, *tip.pos),
            size=(0.011, 0.0, 0.0),
            rgba=_VIOLET,
            material='paint',
        )


def _add_floor(spec: mujoco.MjSpec) -> None:
    """Tiles, and the stand between them and the arm."""
    spec.add_texture(
        name='tiles',
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=(0.93, 0.94, 0.95),
        rgb2=(0.88, 0.89, 0.91),
        width=256,
        height=256,
    )
    tiles = spec.add_material(name='tiles', reflectance=0.0, texrepeat=(2.0, 2.0), texuniform=True)
    tiles.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = 'tiles'
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=(0.0, 0.0, _FLOOR),
        size=(0.0, 0.0, 0.1),
        material='tiles',
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        fromto=(0.0, 0.0, _FLOOR, 0.0, 0.0, 0.0),
        size=(0.1, 0.0, 0.0),
        rgba=(0.6, 0.62, 0.65, 1.0),
    )


def _add_lights(spec: mujoco.MjSpec) -> None:
    """A bright sky, a light that casts shadows, and one beside the camera."""
    spec.add_texture(
        name='sky',
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(1.0, 1.0, 1.0),
        rgb2=(0.86, 0.91, 0.96),
        width=64,
        height=64,
    )
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=(-1.8, 0.6, 3.0),
        dir=(0.5, -0.17, -0.85),
        diffuse=(0.6, 0.6, 0.6),
        specular=(0.4, 0.4, 0.4),
        castshadow=True,
    )
    headlight = spec.visual.headlight
    headlight.ambient[:] = 0.4
    headlight.diffuse[:] = 0.3
    headlight.specular[:] = 0.1
