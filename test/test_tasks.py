"""Tasks: those that are shipped load, and every kind of bad file says what is wrong in one line."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from redres_ros import RedresError, RobotModel, load_task
from redres_ros.errors import FileError, UnknownNameError
from redres_ros.files.installation import share_path

SHIPPED = sorted(path.stem for path in share_path('config/tasks').glob('*.yaml'))

GOOD = {
    'robot': 'lwr4_paper',
    'start': [10, 20.5, 30, 40, 50, 60, 70],
    'waypoints': [[0.1, 0.2, 0.3], [0.1, 0.2, 0.4], [0, 0, 1]],
    'segment_time': 2,
    'feedback_gain': 5.0,
    'tolerance': 0.002,
    'switching': 'within_tolerance',
}


def written(path: Path, **changes: object) -> str:
    """A task file with these keys changed; None leaves a key out."""
    content = {key: value for key, value in (GOOD | changes).items() if value is not None}
    path = path / 'task.yaml'
    path.write_text(yaml.safe_dump(content))
    return str(path)


def refusal(name_or_path: str, error: type[RedresError]) -> str:
    with pytest.raises(error) as caught:
        load_task(name_or_path)
    assert '\n' not in str(caught.value)
    return str(caught.value)


# --- good ones ------------------------------------------------------------------------------------


@pytest.mark.parametrize('name', SHIPPED)
def test_a_shipped_task_starts_at_its_first_point(name):
    task = load_task(name)
    x, _ = RobotModel.named(task.robot).tip(task.start)
    assert np.linalg.norm(x - task.waypoints[0]) < task.tolerance


def test_a_linear_joint_starts_at_so_many_metres(tmp_path):
    task = load_task(written(tmp_path, start=['-0.25 m', 90, 180]))
    assert task.start == pytest.approx([-0.25, np.pi / 2.0, np.pi])


def test_a_file_gives_what_it_says(tmp_path):
    task = load_task(written(tmp_path))
    assert task.robot == 'lwr4_paper'
    assert task.start == pytest.approx(np.radians(GOOD['start']))
    assert task.waypoints.tolist() == GOOD['waypoints']
    assert (task.segment_time, task.feedback_gain, task.tolerance) == (2.0, 5.0, 0.002)
    assert task.switching == 'within_tolerance'


def test_what_a_file_does_not_say_is_as_in_the_paper(tmp_path):
    task = load_task(
        written(tmp_path, segment_time=None, feedback_gain=None, tolerance=None, switching=None)
    )
    assert (task.segment_time, task.feedback_gain, task.tolerance, task.switching) == (
        3.0,
        10.0,
        0.001,
        'at_rest',
    )


def test_a_file_may_have_parameters_of_the_nodes_and_changes_of_them(tmp_path):
    nodes = {'sim': {'contact_shape': 'table', 'contact_position': [0.5, 0.0, 0.1]}}
    events = [{'at': 2, 'node': 'sim', 'push_link': 'elbow'}]
    task = load_task(written(tmp_path, nodes=nodes, events=events))
    assert task.nodes['sim'] == {'contact_shape': 'table', 'contact_position': (0.5, 0.0, 0.1)}
    assert task.events == ((2.0, 'sim', {'push_link': 'elbow'}),)


# --- bad ones -------------------------------------------------------------------------------------


def test_an_unknown_name_is_refused_with_those_that_exist():
    message = refusal('circle', UnknownNameError)
    assert message.startswith("unknown task 'circle'; allowed: a path ending in .yaml, ")
    assert 'rectangle' in message


def test_a_file_that_is_not_there_is_refused_by_path(tmp_path):
    path = f'{tmp_path}/none.yaml'
    assert refusal(path, FileError) == f'cannot read {path}: No such file or directory'


@pytest.mark.parametrize(
    'content', [b'waypoints: [[1, 2', b'a: b: c', b'\xff\xfe\x00 no text', b'\t- x']
)
def test_a_file_that_is_no_yaml_is_refused_by_path(tmp_path, content):
    path = tmp_path / 'task.yaml'
    path.write_bytes(content)
    assert refusal(str(path), FileError).startswith(f'{path} is not YAML: ')


KEYS = 'expected the keys robot, start, waypoints'
SHAPE = 'expected at least two points'
NUMBER = 'expected a number'
NO_PARAMETERS = 'expected parameters below the names of nodes'


@pytest.mark.parametrize(
    ('key', 'value', 'words'),
    [
        ('robot', None, KEYS),
        ('start', None, KEYS),
        ('waypoints', None, KEYS),
        ('tolerence', 0.1, "'tolerence'; allowed: "),
        ('start', [0, 1, 'x'], 'task.yaml: start is '),
        ('start', [0, 1, '1e99 m'], 'task.yaml: start is '),
        ('start', [0, np.nan], 'task.yaml: start is '),
        ('waypoints', [[0, 0, 0], [0, 0]], 'task.yaml: waypoints is '),
        ('waypoints', 'none', 'task.yaml: waypoints is '),
        ('waypoints', [[0, 0, 0]], f'waypoints is [[0, 0, 0]]; {SHAPE}'),
        ('waypoints', [[0, 0, 0, 0]] * 3, SHAPE),
        ('segment_time', 'fast', f"task.yaml: segment_time is 'fast'; {NUMBER}"),
        ('tolerance', [1.0], f'task.yaml: tolerance is [1.0]; {NUMBER}'),
        ('segment_time', 0.0, 'segment_time is 0.0; allowed: '),
        ('tolerance', np.inf, 'tolerance is inf; allowed: '),
        ('switching', 'soon', "unknown switching 'soon'; allowed: at_rest, within_tolerance"),
        ('rpy', [[0, 0, 0]] * 2, '2 orientations; expected one row, or one for each'),
        ('quaternions', [[0, 0, 0, 0]], 'expected rows of 4 numbers x, y, z, w, not all'),
        ('nodes', [1], NO_PARAMETERS),
        ('nodes', {'robot': {}}, "expected a node among sim, controller, planner, not 'robot'"),
        ('events', 5, 'events is 5; expected a list'),
        ('events', [{'at': 1.0}], 'expected events with at [s], node, and parameters'),
        ('events', [{'at': 'x', 'node': 'sim', 'a': 1}], NUMBER),
    ],
)
def test_a_value_that_cannot_be_is_refused_by_its_key(tmp_path, key, value, words):
    assert words in refusal(written(tmp_path, **{key: value}), RedresError)


def test_orientations_in_two_forms_are_refused(tmp_path):
    path = written(tmp_path, quaternions=[[0, 0, 0, 1]], rpy=[[0, 0, 0]])
    assert 'expected one of them' in refusal(path, FileError)


# --- hostile ones: each ends at once, with one line -----------------------------------------------

LAUGHS = 'a0: &a0 [1, 1]\n' + ''.join(
    f'a{i}: &a{i} [{", ".join([f"*a{i - 1}"] * 9)}]\n' for i in range(1, 30)
)
HOSTILE = {
    'a number of 400 digits': ('waypoints: [[1' + '0' * 400 + ', 0, 0], [0, 0, 0]]', 'waypoints'),
    'a number of 400 digits in a scalar': ('segment_time: 1' + '0' * 400, 'segment_time'),
    'a number of 9000 digits': ('tolerance: 1' + '0' * 9000, 'is not YAML'),
    'lists in lists': ('waypoints: ' + '[' * 3000 + ']' * 3000, 'nested too deeply'),
    'an alias bomb': (LAUGHS, 'its aliases stand for more'),
    'an alias of itself': ('waypoints: &a [*a]', 'its aliases'),
    'a point at 1e300': ('waypoints: [[1.0e+300, 0, 0], [0, 0, 0]]', 'none beyond 100'),
    'a joint at 1e300': ('start: [1.0e+300]', 'none beyond 36000'),
    'a list for a name': ('robot: [lwr4]', 'robot'),
    'more than there is memory for': ('# ' + 'x' * 1_000_000, 'is too large'),
}


@pytest.mark.parametrize(('line', 'words'), HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_file_is_refused_with_a_short_line(tmp_path, line, words):
    path = tmp_path / 'task.yaml'
    key = line.partition(':')[0]
    rest = {name: value for name, value in GOOD.items() if name != key}
    path.write_text(f'{line}\n{yaml.safe_dump(rest)}')
    message = refusal(str(path), FileError)
    assert words in message
    assert len(message) < len(str(path)) + 250


# --- orientations ---------------------------------------------------------------------------------

POINTS = len(GOOD['waypoints'])


def test_roll_pitch_and_yaw_are_read_in_degrees(tmp_path):
    task = load_task(written(tmp_path, rpy=[[0, 180, 0], [90, 0, 0], [0, 0, 90]]))
    expected = [np.diag((-1, 1, -1)), [[1, 0, 0], [0, 0, -1], [0, 1, 0]]]
    assert task.orientations.shape == (POINTS, 3, 3)
    assert task.orientations[:2] == pytest.approx(np.array(expected), abs=1e-15)


def test_quaternions_are_read_as_x_y_z_w_of_any_length(tmp_path):
    task = load_task(written(tmp_path, quaternions=[[0, 0, 0, 2], [3, 0, 0, 0], [0, 0, 1, 0]]))
    assert task.orientations[0] == pytest.approx(np.eye(3))
    assert task.orientations[1] == pytest.approx(np.diag((1, -1, -1)))
