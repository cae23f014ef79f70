"""Laws and the like of one's own, without editing the package: from a file, or a package."""

import re
from pathlib import Path

import pytest
from programs import run_python

from redres_ros.cli import main
from redres_ros.files import plugins
from redres_ros.files.plugins import PluginError, load_plugin
from redres_ros.laws import LAWS, make_law
from redres_ros.limits import LIMITS
from redres_ros.preferences import PREFERENCES
from redres_ros.tasks import TASKS

EXAMPLE = Path(__file__).parent.parent / 'examples' / 'own_law.py'
PREFERENCE = EXAMPLE.with_name('own_preference.py')


@pytest.fixture(autouse=True)
def unspoiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tables and what was loaded are as before after each test."""
    monkeypatch.setattr(plugins, '_loaded', {})
    for table in (LAWS, PREFERENCES, TASKS, LIMITS):
        before = dict(table)
        for name in before:
            monkeypatch.setitem(table, name, before[name])
    yield
    for table in (LAWS, PREFERENCES, TASKS, LIMITS):
        for name in [name for name, cls in table.items() if 'plugin' in cls.__module__]:
            del table[name]


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding='utf-8')
    return path


def test_what_a_file_defines_is_in_the_tables() -> None:
    assert load_plugin(EXAMPLE) == ('wrist_first',)
    assert load_plugin(PREFERENCE) == ('elbow_forward',)
    cls = LAWS['wrist_first']
    assert load_plugin(str(EXAMPLE)) == ('wrist_first',)  # once
    assert LAWS['wrist_first'] is cls
    assert make_law('wrist_first', ratio=3.0).ratio == 3.0
    assert 'elbow_forward' in PREFERENCES


def test_a_law_of_ones_own_is_a_choice_of_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    command = (
        f'simulate --plugin {EXAMPLE} --law wrist_first --set wrist_first.ratio=3 --period 0.02'
    )
    assert main(command.split()) == 0
    assert 'wrist_first' in capsys.readouterr().out
    assert main(['laws', f'--plugin={PREFERENCE}']) == 0
    assert 'elbow_forward' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('1 / 0', 'cannot be loaded: ZeroDivisionError'),
        ('raise SystemExit', 'cannot be loaded: SystemExit'),
        ('import no_such_package', 'cannot be loaded: ModuleNotFoundError'),
        ('x = 1', 'defines no law, preference, task or limit'),
        (
            'from redres_ros.laws import MinimumVelocity as Base\n'
            'class MinimumVelocity(Base): pass',
            'defines minimum_velocity, which exists already',
        ),
    ],
)
def test_a_file_that_is_no_plugin_is_refused_in_one_line(
    text: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path / 'own.py', text)
    before = dict(LAWS)
    with pytest.raises(PluginError, match=reason):
        load_plugin(file)
    assert before == LAWS
    assert main(['laws', '--plugin', str(file)]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PluginError, match='expected an existing Python file'):
        load_plugin(tmp_path / 'nowhere.py')


@pytest.mark.slow
def test_a_package_that_is_installed_brings_its_laws_by_entry_point(tmp_path: Path) -> None:
    info = tmp_path / 'my_laws-1.0.dist-info'
    info.mkdir()
    written(info / 'METADATA', 'Metadata-Version: 2.1\nName: my_laws\nVersion: 1.0\n')
    groups = '[redres_ros.laws]\nwrist_first = my_laws:WristFirst\nbroken = my_laws:Nothing\n'
    written(info / 'entry_points.txt', groups)
    # Of the package only what the tables need: they ask for it before the rest is loaded.
    needed = r'\1Law, RobotState, param'
    text = re.sub('(from redres_ros import ).*', needed, EXAMPLE.read_text(encoding='utf-8'))
    written(tmp_path / 'my_laws.py', text)
    program = (
        f'import sys; sys.path.insert(0, {str(tmp_path)!r}); from redres_ros import make_law; '
        'print(type(make_law("wrist_first")).__module__)'
    )
    done = run_python('-c', program, check=True)
    assert done.stdout.strip() == 'my_laws'
    assert 'broken of my_laws:Nothing is left out' in done.stderr


def test_a_node_takes_laws_of_ones_own_and_their_gains() -> None:
    pytest.importorskip('rclpy', reason='needs ROS 2: pip install .[test]')
    from virtual_graph import virtual_run

    own = {'plugins': [str(EXAMPLE)], 'law': 'wrist_first', 'wrist_first.ratio': 3.0}
    with virtual_run(controller={**own, 'rate': 100.0}) as run:
        assert run.nodes['controller']._controller.law == LAWS['wrist_first'](ratio=3.0)
