"""The command line, as far as it needs no ROS: what it writes and refuses, and its status."""

import argparse
import shlex
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from redres_ros import LAWS, Controller, RedresError, RobotModel, load_task, make_law
from redres_ros.cli import main, make_parser
from redres_ros.cli.motion import find_motions, node_parameters
from redres_ros.robots import ARMS
from redres_ros.robots.joint_limits import with_accelerations
from redres_ros.simulation.closed_loop import run
from redres_ros.simulation.recording import columns


@pytest.fixture
def short(tmp_path: Path) -> str:
    """A task of 0.2 s from the paper's start."""
    path = tmp_path / 'short.yaml'
    path.write_text(
        'robot: lwr4_paper\nstart: [28.08, 104.12, 114.59, 94.85, 14.32, -28.12, 0.0]\n'
        'waypoints: [[-0.4, 0.36, 0.01], [-0.4, 0.35, 0.01]]\nsegment_time: 0.2\n'
    )
    return str(path)


def simulate(short: str, path: Path, *options: str) -> np.ndarray:
    """The table that `redres simulate` writes."""
    assert main(['simulate', '--task', short, '--out', str(path), *options]) == 0
    return np.loadtxt(path, delimiter=',', skiprows=1)


def test_simulate_writes_the_columns_that_users_rely_on_and_its_end(short, tmp_path, capsys):
    simulate(short, tmp_path / 'motion.csv', '--law', 'minimum_velocity')
    assert (tmp_path / 'motion.csv').read_text().splitlines()[0] == ','.join(columns(7))
    out = capsys.readouterr().out
    assert 'reached the last point after 0.200 s' in out
    assert 'minimum_velocity' in out


@pytest.mark.parametrize('law', LAWS)
def test_simulate_is_the_ideal_loop_to_the_last_bit(short, tmp_path, law):
    given = f'{law}@20' if LAWS[law].has_memory else law
    table = simulate(short, tmp_path / 'motion.csv', '--law', given, '--period', '0.002')
    controller = Controller(RobotModel.named('lwr4_paper'), make_law(law, damping=20.0), 0.002)
    assert table.tobytes() == run(controller, load_task(short)).data.tobytes()


@pytest.mark.parametrize(
    'options',
    [
        ('--dynamics', 'cylinders'),
        ('--switch-time', '0.1'),
        ('--law', 'minimum_torque'),
        ('--damping', '100'),
        ('--period', '0.002'),
        ('--limits', 'acceleration', '--limit-scale', '0.1'),
        ('--limits', 'acceleration', '--set', 'acceleration_limit=[1, 1, 1, 1, 1, 1, 1]'),
        ('--limits', 'torque', '--torque-scale', '0.12'),
        ('--prefer', 'posture=100', '--set', 'posture.target=[0, 0, 0, 0, 0, 0, 0]'),
        ('--prefer', 'joint_centering', 'elbow_height=10'),
        ('--secondary', 'orientation'),
        ('--secondary', 'orientation', 'joint', '--set', 'task_gain=5'),
    ],
    ids=' '.join,
)
def test_every_option_acts(short, tmp_path, options):
    law = ('--law', 'dynamically_consistent') if '--law' not in options else ()
    a = simulate(short, tmp_path / 'motion.csv', '--law', 'dynamically_consistent')
    b = simulate(short, tmp_path / 'motion.csv', *law, *options)
    assert a.shape != b.shape or (a != b).any()


def test_simulate_fails_when_the_arm_does_not_arrive(short, tmp_path, capsys):
    task = tmp_path / 'open_loop.yaml'  # the start's distance of 0.15 mm from x_0 stays
    task.write_text(Path(short).read_text() + 'feedback_gain: 0.0\ntolerance: 1.0e-5\n')
    out = tmp_path / 'motion.csv'
    assert main(['simulate', '--task', str(task), '--out', str(out)]) == 1
    assert 'did not reach the last point' in capsys.readouterr().out
    assert out.is_file()  # how it went is what one wants to see then


def test_a_table_that_simulate_wrote_is_a_task_with_the_same_motion(short, tmp_path, capsys):
    table = tmp_path / 'motion.csv'
    q = simulate(short, table)[:-1, 1:8]  # the last row is the end, and makes none
    assert simulate(str(table), tmp_path / 'again.csv')[:, 1:8] == pytest.approx(q, abs=1e-5)
    assert main(['compare', '--task', str(table), '--out', str(tmp_path)]) == 0
    assert 'the best motion along the path' in capsys.readouterr().out


def test_compare_names_the_laws_on_which_a_preference_does_not_act(short, tmp_path, capsys):
    laws = ['--law', 'minimum_velocity,minimum_acceleration', '--prefer', 'posture']
    assert main(['compare', '--task', short, *laws, '--out', str(tmp_path)]) == 0
    assert 'preferences and damping do not act on minimum_velocity\n' in capsys.readouterr().out


REFUSED = [
    ('simulate --law fastest', "unknown law 'fastest'; allowed: dynamically_consistent, "),
    ('compare --law minimum_velocity@x', '--law minimum_velocity@x; expected a name, NAME@'),
    ('simulate --law minimum_torque@=3', '--law minimum_torque@=3; expected a name, NAME@DAMPING '),
    ('compare --law minimum_velocity@-1', 'damping is -1.0; allowed: 0 to 1'),
    ('demo --law minimum_velocity@5', '--law minimum_velocity@5; minimum_velocity has no velocity'),
    ('watch --set law=minimum_torque@5', '--set law=minimum_torque@5; expected two settings, s'),
    ('simulate --law minimum_velocity@horizon=1', "unknown gain of minimum_velocity 'horizon'"),
    ('compare --law minimum_acceleration@horizon=20', 'horizon is 20.0; allowed: 0 to 10'),
    ('compare --law minimum_velocity,minimum_velocity', '--law minimum_velocity is named twice'),
    ('compare --law minimum_torque,minimum_torque@10', '--law minimum_torque, k_d = 10 1/s is '),
    ('simulate --task circle', "unknown task 'circle'; allowed: "),
    ('simulate --task none.yaml', 'cannot read none.yaml'),
    ('simulate --robot r2d2', "unknown robot 'r2d2'; allowed: a path ending in .urdf, "),
    ('simulate --robot fr3 --task rectangle', 'the tip of fr3 is 794 mm away from the first'),
    ('simulate --robot planar4r --task rectangle', 'start of a task of planar4r has 7 joints; exp'),
    ('simulate --tip hand', "unknown frame 'hand'; allowed: "),
    ('simulate --limits speed', "unknown limit 'speed'; allowed: acceleration, collision, "),
    ('simulate --limits position,position', "limit 'position' is named twice; allowed: once"),
    ('simulate --limit-scale 0.5', '--limit-scale 0.5 acts on limits; in use: none, see --limits'),
    ('simulate --torque-scale 0.5 --limits velocity', '--torque-scale 0.5 acts on the limit '),
    ('simulate --prefer posture=high', '--prefer posture=high; expected NAME=GAIN, such as '),
    ('simulate --prefer posture=-1', 'posture.gain is -1.0; allowed: 0 to '),
    ('simulate --set posture.gain=1', '--set posture.gain acts on the preference posture; in '),
    ("simulate --set 'axis.axis=[1, 0, 0]'", '--set axis.axis acts on the task axis; in use: law '),
    ('simulate --set posture.gian=1', "unknown gain 'posture.gian' (is posture.gain meant?); "),
    ('simulate --law minimum_velocity --prefer posture', '--prefer acts on laws with velocity '),
    ('simulate --law minimum_velocity --set damping=5', '--set damping acts on laws with '),
    ('simulate --law minimum_velocity --damping 5', '--damping acts on laws with velocity '),
    ('simulate --set posture.gain', '--set posture.gain; expected NAME=VALUE, such as'),
    ('simulate --set acceleration_limit=3', '--set acceleration_limit=3; expected a list, such'),
    ('simulate --set =1', '--set =1; expected NAME=VALUE'),
    ('simulate --prefer posture --set posture.gain=high', "posture.gain is 'high'; allowed: "),
    ('simulate --dynamics rods', "unknown dynamics 'rods'; allowed: cylinders, identified"),
    ('simulate --damping nan', 'damping is nan; allowed: 0 to'),
    ('compare --period nan', 'period is nan; allowed: 1e-05 to 1'),
    ('simulate --switch-time -1', 'switch_time is -1.0; allowed: 0 to 60'),
    ('demo --prefer posture --set posture.target=[0]', '--set posture.target is not for'),
    ('demo --damping 501', 'damping is 501.0; allowed: 0 to 500'),
    ('demo --period 0', 'period is 0.0; allowed: 0.0005'),
    ('demo --out /dev/null/here', 'cannot write /dev/null/here/motion.csv: Not a directory'),
    ('demo --domain 500', 'ROS domain is 500 (--domain or ROS_DOMAIN_ID); allowed: 0 to 232'),
]


@pytest.mark.parametrize(('line', 'message'), REFUSED, ids=[line for line, _ in REFUSED])
def test_what_cannot_be_done_is_refused_in_one_line(line, message, tmp_path, monkeypatch, capsys):
    if line.startswith(('demo', 'watch')):
        pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')
    monkeypatch.chdir(tmp_path)
    words = shlex.split(line)
    assert main(words) == 1
    captured = capsys.readouterr()
    assert captured.out == ''
    assert captured.err.startswith(f'redres {words[0]}: {message}')
    assert captured.err.count('\n') == 1


def test_an_arm_whose_joints_form_a_circle_is_refused(tmp_path, capsys):
    joint = '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/></joint>'
    joints = joint.format('there', 'a', 'b') + joint.format('back', 'b', 'a')
    path = tmp_path / 'circle.urdf'
    path.write_text(f'<robot name="circle"><link name="a"/><link name="b"/>{joints}</robot>')
    assert main(['simulate', '--robot', str(path)]) == 1
    assert 'the joints form a circle' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('line', 'blocked', 'reason'),
    [
        ('simulate --out file/a.csv', 'file/a.csv', 'File exists'),
        (f'simulate --out {"x" * 300}.csv', f'{"x" * 300}.csv', 'File name too long'),
        ('simulate --out file', 'file/motion.csv', 'File exists'),
        ('compare --out .', 'comparison.png', 'Is a directory'),
        ('demo --out .', 'sim.log', 'Is a directory'),
    ],
    ids=['under a file', 'too long', 'in a file', 'a plot', 'a log'],
)
def test_a_file_that_cannot_be_written_is_refused_before_the_work(
    tmp_path, monkeypatch, capsys, line, blocked, reason
):
    monkeypatch.chdir(tmp_path)
    Path('file').write_text('')
    Path('comparison.png').mkdir()
    Path('sim.log').mkdir()
    words = line.split()
    assert main(words) == 1
    captured = capsys.readouterr()
    assert captured.err == f'redres {words[0]}: cannot write {blocked}: {reason}\n'
    assert captured.out == ''


@pytest.mark.parametrize(
    ('line', 'words'),
    [
        ('dance', 'dance'),
        ('simulate --damp 1', '--damp'),
        ('simulate --scaling component', '(is components meant?); allowed: components, task'),
        ('simulate --damping much', 'much'),
        ('simulate --view page', 'unknown: --view page; see redres simulate --help'),
        ('simulate --law=', 'got nothing for --law; expected a value'),
        (f'watch --namespace {"x" * 121}', 'of at most 120 characters'),
        ('check --states 1a', "got '1a'; expected names with / between them"),
        ('simulate --out x.pdf', 'a directory, such as x, or a file that ends in .csv; see'),
        ('compare --out x.pdf', "'x.pdf'; expected a directory, such as x; see"),
        ('reproduce --out a/x.csv', "'a/x.csv'; expected a directory, such as a/x; see"),
        ('batch study.yaml', 'batch is gone; instead: `for result in batch(cases)`'),
        ('law minimum_velocity', 'law is gone; instead: redres watch --set law=NAME'),
        ('reproduce contact', 'contact is gone; instead: python docs/make_contact.py'),
        ('simulate --delay 0.01', '--delay is gone; instead: `run(controller, task, plant='),
        ('simulate --posture.gain 4', '--posture.gain is gone; instead: --set posture.gain=VALUE'),
        ('simulate --collision.floor 0', '.floor is gone; instead: set scene.obstacles'),
        ('demo --teleop', '--teleop is gone; instead: --view'),
        ('demo --view window', 'window is gone; instead: --view'),
        ('demo --switch minimum_velocity@1', '--switch is gone; instead: `ros2 param set'),
        ('compare --tasks 5', '--tasks is gone; instead: `for result in batch(cases)`'),
    ],
)
def test_a_wrong_command_line_has_status_two_and_says_why_in_one_line(line, words, capsys):
    with pytest.raises(SystemExit) as caught:
        main(line.split())
    assert caught.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith('redres')
    assert words in said
    assert said.endswith('--help\n')
    assert said.count('\n') == 1


def test_redres_alone_says_what_to_try_first(capsys):
    assert main([]) == 2
    said = capsys.readouterr().err
    assert all(f'    {command} ' in said for command in ('demo', 'simulate', 'compare', 'laws'))


def test_the_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as caught:
        main(['--version'])
    assert caught.value.code == 0
    declared = ElementTree.parse(Path(__file__).parents[1] / 'package.xml').findtext('version')
    assert capsys.readouterr().out == f'redres_ros {declared}\n'


def test_laws_lists_every_law_with_its_equation_every_gain_and_every_arm(capsys):
    assert main(['laws']) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    for name in LAWS:
        assert [line for line in lines if line.startswith(f'{name} ') and 'Eq. (' in line]
    names = {line.partition(' ')[0] for line in lines}
    assert {*ARMS, 'position.margin', 'posture.target'} <= names
    (damping,) = (line for line in lines if line.startswith('damping '))
    assert damping.endswith('default: 10')


def help_of(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as caught:
        main([*command.split(), '--help'])
    assert caught.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    'command', ['', 'simulate', 'compare', 'reproduce', 'demo', 'laws', 'watch']
)
def test_help_shows_no_default_that_says_nothing(command, capsys):
    shown = help_of(command, capsys)
    assert shown.startswith(f'usage: redres {command}'.strip())
    for nothing in ('[]', '()', 'None', 'False', ''):
        assert f'; default: {nothing}\n' not in shown


def test_every_command_has_examples_and_each_can_be_parsed():
    [commands] = [a for a in make_parser()._actions if isinstance(a, argparse._SubParsersAction)]
    for name, command in commands.choices.items():
        examples = command.epilog.splitlines()[1:]
        assert examples, name
        for example in examples:
            redres, *words = shlex.split(example.partition(' > ')[0], comments=True)
            assert redres == 'redres'
            assert make_parser().parse_args(words).command == name


@pytest.mark.parametrize('command', ['simulate', 'compare', 'demo'])
def test_every_motion_has_the_options_that_users_rely_on(command, capsys):
    shown = help_of(command, capsys)
    own = '--law --damping --limits --limit-scale --torque-scale --prefer --secondary --set'
    assert all(f'{option} ' in shown for option in [*own.split(), '--robot', '--tip', '--task'])


@pytest.mark.slow
@pytest.mark.parametrize('name', ['iiwa7', 'planar4r'])
def test_a_robot_does_its_own_task_by_default(name, tmp_path, capsys):
    assert main(['simulate', '--robot', name, '--period', '0.01']) == 0
    implied = capsys.readouterr().out
    assert main(['simulate', '--task', ARMS[name].task, '--period', '0.01']) == 0
    assert capsys.readouterr().out == implied


def test_a_task_with_orientations_is_done_in_six_dimensions(tmp_path):
    path = tmp_path / 'motion.csv'
    assert main(['simulate', '--task', 'iiwa7_pose', '--period', '0.01', '--out', str(path)]) == 0
    assert path.read_text().splitlines()[0] == ','.join(columns(7, pose=True))


def test_a_robot_may_be_a_file(tmp_path, capsys):
    arm = ARMS['iiwa7']
    options = ['--task', arm.task, '--period', '0.01', '--law', 'minimum_velocity']
    for robot in ('iiwa7', arm.source):
        path = tmp_path / f'{len(robot)}.csv'
        assert main(['simulate', *options, '--robot', robot, '--out', str(path)]) == 0
    a, b = (path.read_text() for path in tmp_path.glob('*.csv'))
    assert a == b


def test_another_tip_gets_a_path_of_its_own(capsys):
    urdf = ARMS['iiwa7'].source
    assert main(['simulate', '--robot', urdf, '--tip', 'lbr_link_7', '--period', '0.01']) == 0
    assert 'a square before the tip' in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(('limits', 'is_loaded'), [('none', False), ('velocity', True)])
def test_a_command_loads_what_it_needs(short, limits, is_loaded):
    program = (
        'import atexit, os, sys\n'
        'from redres_ros.cli import main\n'
        "atexit.register(lambda: os._exit('redres_ros.kernels.active_set' in sys.modules))\n"
        'main(sys.argv[1:])\n'
    )
    words = ['simulate', '--task', short, '--limits', limits]
    done = subprocess.run([sys.executable, '-c', program, *words], timeout=120, check=False)
    assert done.returncode == is_loaded


def test_a_joint_limits_file_limits_accelerations_and_slows_joints_and_lacks_none(tmp_path):
    arm = ARMS['planar4r']
    own = RobotModel(arm).dq_max
    text = 'joint_limits:\n'
    for number, velocity in enumerate((1000, 0.5, 1000, 1000), 1):
        text += f'  joint_{number}: {{has_velocity_limits: true, max_velocity: {velocity}, '
        text += f'has_acceleration_limits: true, max_acceleration: {number}}}\n'
    path = tmp_path / 'joint_limits.yaml'
    path.write_text(text)
    model = RobotModel(with_accelerations(arm, str(path)))
    assert model.arm.acceleration_limit == (1.0, 2.0, 3.0, 4.0)
    assert model.dq_max.tolist() == [own[0], 0.5, *own[2:]]
    path.write_text(text.replace('joint_3', 'finger'))
    with pytest.raises(RedresError, match=r'limits.yaml does not limit joint_3; expected'):
        with_accelerations(arm, str(path))


def test_acceleration_limits_of_the_command_line_reach_the_nodes_and_none_is_assumed(tmp_path):
    path = tmp_path / 'arm.urdf'
    path.write_text(RobotModel.named('planar4r').arm.description())
    words = f'simulate --robot {path} --tip tool0 --set acceleration_limit=[1,2,3,4]'.split()
    [motion] = find_motions(make_parser().parse_args(words), ['minimum_torque'])
    assert node_parameters(motion)['acceleration_limit'] == (1.0, 2.0, 3.0, 4.0)
    assert 'assumed' not in ' '.join(motion.model.arm.remarks())
