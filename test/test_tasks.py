"""Tasks: those that are shipped load, and every kind of bad file says what is wrong in one line."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from redres_ros import RedresError, RobotModel, load_task
from redres_ros.errors import FileError
from redres_ros.files.installation import share_path
from redres_ros.planning.waypoints import task_for

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
    message = str(caught.value)
    assert '\n' not in message
    return message


@pytest.mark.parametrize('name', SHIPPED)
def test_a_shipped_task_starts_at_its_first_point(name):
    task = load_task(name)
    x, _ = RobotModel.named(task.robot).tip(task.start)
    assert np.linalg.norm(x - task.waypoints[0]) < task.tolerance


def test_a_linear_joint_starts_at_so_many_metres(tmp_path):
    task = load_task(written(tmp_path, start=['-0.25 m', 90, 180]))
    assert task.start == pytest.approx([-0.25, np.pi / 2.0, np.pi])


def test_a_file_gives_what_it_says_and_otherwise_the_papers_figures(tmp_path):
    task = load_task(written(tmp_path))
    assert task.robot == 'lwr4_paper'
    assert task.start == pytest.approx(np.radians(GOOD['start']))
    assert task.waypoints.tolist() == GOOD['waypoints']
    defaults = {'segment_time': 3.0, 'feedback_gain': 10.0, 'tolerance': 0.001}
    defaults['switching'] = 'at_rest'
    unsaid = load_task(written(tmp_path, **dict.fromkeys(defaults)))
    for name, default in defaults.items():
        assert getattr(task, name) == GOOD[name]
        assert getattr(unsaid, name) == default


def test_a_file_may_have_parameters_of_the_nodes_and_changes_of_them(tmp_path):
    nodes = {'sim': {'contact_shape': 'table', 'contact_position': [0.5, 0.0, 0.1]}}
    events = [{'at': 2, 'node': 'sim', 'push_link': 'elbow'}]
    task = load_task(written(tmp_path, nodes=nodes, events=events))
    assert task.nodes['sim'] == {'contact_shape': 'table', 'contact_position': (0.5, 0.0, 0.1)}
    assert task.events == ((2.0, 'sim', {'push_link': 'elbow'}),)


def test_a_file_that_is_not_there_is_refused_by_path(tmp_path):
    path = f'{tmp_path}/none.yaml'
    assert refusal(path, FileError) == f'cannot read {path}: No such file or directory'


@pytest.mark.parametrize(
    'content', [b'waypoints: [[1, 2', b'a: b: c', b'\xff\xfe\x00 no text', b'\t- x']
)
def test_a_file_that_is_no_yaml_is_refused_by_path(tmp_path, content):
    path = tmp_path / 'task.yaml'
    path.write_bytes(content)
    said = refusal(str(path), FileError)
    assert said.startswith((f'{path} is not YAML: ', f'cannot read {path}: '))


@pytest.mark.parametrize(
    ('key', 'value'),
    [
        ('robot', None),
        ('start', None),
        ('waypoints', None),
        ('tolerence', 0.1),
        ('start', [0, 1, 'x']),
        ('start', [0, 1, '1e99 m']),
        ('start', [0, np.nan]),
        ('waypoints', [[0, 0, 0], [0, 0]]),
        ('waypoints', 'none'),
        ('waypoints', [[0, 0, 0]]),
        ('waypoints', [[0, 0, 0, 0]] * 3),
        ('segment_time', 'fast'),
        ('segment_time', 0.0),
        ('tolerance', [1.0]),
        ('tolerance', np.inf),
        ('switching', 'soon'),
        ('quaternions', [[0, 0, 0, 0]]),
        ('nodes', [1]),
        ('nodes', {'robot': {}}),
        ('events', 5),
        ('events', [{'at': 1.0}]),
        ('events', [{'at': 'x', 'node': 'sim', 'a': 1}]),
    ],
)
def test_a_value_that_cannot_be_is_refused_by_its_key(tmp_path, key, value):
    assert key in refusal(written(tmp_path, **{key: value}), RedresError)


@pytest.mark.parametrize(
    'given',
    [
        {'rpy': [[0, 0, 0]] * 2},
        {'rpy': [[0, 0, 0]], 'quaternions': [[0, 0, 0, 1]]},
        {'times': [0, 1, 2]},
    ],
    ids=['two of three', 'in two forms', 'timed twice'],
)
def test_orientations_and_times_that_leave_something_open_are_refused(tmp_path, given):
    refusal(written(tmp_path, **given), RedresError)


def test_a_table_is_a_task_that_starts_at_its_first_pose(tmp_path):
    path = tmp_path / 'path.csv'
    path.write_text('# t,x,y,z,qx,qy,qz,qw\n1e9,.5,-.5,.2,1,0,0,0\n1000000001.5,.5,-.4,.2,1,0,0,0')
    model = RobotModel.named('fr3')
    task = task_for(model.arm, 'fr3', str(path))
    assert task.times.tolist() == [0.0, 1.5]
    x, R = model.tip(task.start)
    assert x == pytest.approx(task.waypoints[0], abs=1e-6)
    assert pytest.approx(DOWN, abs=1e-6) == R


@pytest.mark.parametrize(
    ('table', 'words'),
    [
        ('', 'has no column t, x, y, z'),
        ('t,x,y,z\n0,0,0,0\n1,nan,0,0', 'row 2 lacks a number'),
        ('t,x,y,z\n0,0,0,0\n0,0,0,0', 'row 2 lacks a number, or a t above the last'),
        ('t,x,y,z\n0,0,0,0\n1,0,0', 'is no table'),
    ],
)
def test_a_table_that_is_no_path_is_refused_with_what_is_wrong(tmp_path, table, words):
    path = tmp_path / 'path.csv'
    path.write_text(table)
    assert words in refusal(str(path), FileError)


HOSTILE = {
    'a number of 400 digits': ('waypoints: [[1' + '0' * 400 + ', 0, 0], [0, 0, 0]]', 'waypoints'),
    'a number of 400 digits in a scalar': ('segment_time: 1' + '0' * 400, 'segment_time'),
    'a number of 9000 digits': ('tolerance: 1' + '0' * 9000, 'is not YAML'),
    'lists in lists': ('waypoints: ' + '[' * 100_000, 'nest'),  # as libyaml, or we, say
    'an alias of itself': ('waypoints: &a [*a]', 'waypoints'),
    'a point at 1e300': ('waypoints: [[1.0e+300, 0, 0], [0, 0, 0]]', 'none beyond 100'),
    'a joint at 1e300': ('start: [1.0e+300]', 'none beyond 36000'),
    'a list for a name': ('robot: [lwr4]', 'robot'),
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


DOWN = np.diag((1, -1, -1))


@pytest.mark.parametrize(
    ('form', 'rows'),
    [
        ('rpy', [[0, 0, 0], [180, 0, 0], [90, 0, 0]]),
        ('quaternions', [[0, 0, 0, 2], [3, 0, 0, 0], [1, 0, 0, 1]]),  # x, y, z, w of any length
    ],
)
def test_orientations_are_read_from_either_form(tmp_path, form, rows):
    task = load_task(written(tmp_path, **{form: rows}))
    expected = (np.eye(3), DOWN, [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert task.orientations == pytest.approx(np.array(expected), abs=1e-15)
