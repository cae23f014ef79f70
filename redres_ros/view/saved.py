"""A recorded motion as a page that replays it, in any browser and without a server."""

from pathlib import Path

import numpy as np

from redres_ros.files.text import writing
from redres_ros.planning.waypoints import WaypointTask
from redres_ros.robot_model import RobotModel
from redres_ros.simulation.recording import Recording
from redres_ros.view.origin_check import CONTENT, close_server, open_server
from redres_ros.view.scene import ArmScene

_RATE = 20.0  # pictures a second
_TRACED = 4  # pictures from one drawing of the paths to the next
_LAST = 1.5  # [s] for which the last picture stays
_LABEL = np.array((0.0, 0.0, 1.25))  # of the arm's reach: where the title stands


def write_page(
    recording: Recording, model: RobotModel, task: WaypointTask, title: str, path: Path
) -> None:
    """Write a page.

    Args:
        recording: The motion, of at least one row.
        model: Model of the arm that moved.
        task: Its task.
        title: Beside the arm.
        path: Path of the file.

    Raises:
        FileError: The file cannot be written.
    """
    server = open_server(0, 'redres')
    try:
        scene = ArmScene(server, model, task.waypoints)
        server.scene.add_label('/title', title, position=model.reach * _LABEL)
        serializer = server.get_scene_serializer()
        paths: dict[str, list[np.ndarray]] = {}
        for number, q in enumerate(_postures(recording)):
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
    with writing(path):
        path.write_text(_closed(page), encoding='utf-8')


def _postures(recording: Recording) -> np.ndarray:
    """q at each picture, (N, n) [rad]."""
    t = recording['t']
    times = np.arange(t[0], t[-1] + 0.5 / _RATE, 1.0 / _RATE)
    return recording.vectors('q1')[recording.rows_at(times)]


def _closed(page: str) -> str:
    """The page with a policy by which the browser loads nothing else."""
    policy = CONTENT.format(connect='')
    rule = f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
    return page.replace('<head>', f'<head>{rule}', 1)
