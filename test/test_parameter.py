"""Parameters: declared once, read by everybody, and checked."""

from dataclasses import dataclass, fields

import numpy as np
import pytest
import yaml

from redres_ros.errors import RangeError, UnknownNameError, quoted
from redres_ros.fake_robot.session import SessionSettings
from redres_ros.files.installation import share_path
from redres_ros.parameter import Checked, Parameter, check_value, param, parameters
from redres_ros.planning.goals import GoalSettings
from redres_ros.robots import Arm


@dataclass(frozen=True)
class Settings(Checked):
    """As any class of the package declares its parameters."""

    gain: float = param(2.0, 'feedback gain [1/s]', 0.0, 10.0, live=True)
    shape: str = param('round', 'its form', choices=('round', 'square'))
    free: bool = param(True, 'may be anything')
    plain: int = 3


def test_the_declaration_is_read_back_from_class_and_instance_alike():
    for source in (Settings, Settings(gain=3.0)):
        declared = {field.name: parameter for field, parameter in parameters(source).items()}
        assert list(declared) == ['gain', 'shape', 'free']
        assert declared['gain'] == Parameter('feedback gain [1/s]', 0.0, 10.0, live=True)
        assert declared['shape'] == Parameter('its form', choices=('round', 'square'))


@pytest.mark.parametrize('gain', [0.0, 5, 10.0])
def test_the_ends_of_the_range_are_allowed(gain):
    assert Settings(gain=gain).gain == gain


@pytest.mark.parametrize('gain', [-1e-12, 10.000001, float('nan'), float('inf'), -float('inf')])
def test_a_value_outside_its_range_is_refused_with_the_range(gain):
    with pytest.raises(RangeError, match=f'gain is {gain}; allowed: 0 to 10') as caught:
        Settings(gain=gain)
    assert (caught.value.name, caught.value.lower, caught.value.upper) == ('gain', 0.0, 10.0)


def test_settings_of_goals_and_of_sessions_are_checked_when_they_are_made():
    for kind, name in ((GoalSettings, 'target_speed'), (SessionSettings, 'monitor_time')):
        with pytest.raises(RangeError, match=f'{name} is -1.0; allowed'):
            kind(**{name: -1.0})


def test_a_word_that_is_no_choice_is_refused_with_the_choices():
    with pytest.raises(UnknownNameError, match="unknown shape 'oval'; allowed: round, square"):
        Settings(shape='oval')


@pytest.mark.parametrize(
    ('limits', 'good', 'bad'), [({'lower': 0.0}, 5.0, -1.0), ({'upper': 0.0}, -5.0, 1.0)]
)
def test_a_range_may_be_open_on_one_side(limits, good, bad):
    check_value('x', good, Parameter('', **limits))
    for value in (bad, float('nan'), None):
        with pytest.raises(RangeError, match='x'):
            check_value('x', value, Parameter('', **limits))


def test_the_parameter_file_leaves_alone_what_follows_from_the_robot():
    # Else `robot: lwr4` with this file would be the bare arm with the paper's tool.
    content = yaml.safe_load(share_path('config/redres.yaml').read_text(encoding='utf-8'))
    set_there = {key for node in content.values() for key in node['ros__parameters']}
    assert 'robot' in set_there
    assert set_there & {field.name for field in fields(Arm)} == set()


@pytest.mark.parametrize('kind', [np.float32, np.float64, np.int64, np.uint8])
def test_a_numpy_scalar_is_taken_as_the_number_that_it_holds(kind):
    settings = Settings(gain=kind(5))
    assert settings.gain == 5
    assert type(settings.gain) in (int, float)


@pytest.mark.parametrize('value', ['5', 1j, np.complex128(1), np.array(5.0), [5.0], None])
def test_what_is_no_real_number_is_refused(value):
    with pytest.raises(RangeError, match='a number'):
        Settings(gain=value)


@pytest.mark.parametrize('members', [(0.0, float('nan')), (11.0,), (1.0, '2')])
def test_every_member_of_a_tuple_has_to_be_in_the_range(members):
    check_value('x', (0.0, 10.0), Parameter('', 0.0, 10.0))
    with pytest.raises(RangeError):
        check_value('x', members, Parameter('', 0.0, 10.0))


@pytest.mark.parametrize(
    'value', ['x' * 1000, 'two\nlines', 10**400, 10**9000, [[0.0] * 1000]], ids='abcde'
)
def test_a_value_is_quoted_on_one_short_line(value):
    assert '\n' not in quoted(value)
    assert 0 < len(quoted(value)) < 70
