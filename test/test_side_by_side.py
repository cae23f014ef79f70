"""What a student types: names that complete, laws compared, a plot, an arm from a URDF."""

from pathlib import Path

import numpy as np
import pytest

import redres_ros
from redres_ros import RobotModel, compare, load_task, make_law, plot
from redres_ros.errors import ArrayError, FileError
from redres_ros.planning.waypoints import task_for
from redres_ros.robots import find_arm

T = 0.02  # [s]


def test_every_public_name_is_there_and_completes() -> None:
    assert {'run', 'compare', 'plot', 'param', 'load_task', 'Recording'} <= set(dir(redres_ros))
    assert all(hasattr(redres_ros, name) for name in dir(redres_ros))


def test_laws_are_compared_by_name_or_with_gains_of_their_own(tmp_path: Path) -> None:
    laws = ('minimum_velocity', make_law('minimum_acceleration', damping=5.0))
    found = compare(laws, 'side_to_side', T=T)
    assert list(found.efforts) == ['minimum_velocity', 'minimum_acceleration, k_d = 5 1/s']
    assert 'within the limits?' in str(found)
    assert len(plot(found).axes) == 4
    plot(found.recordings['minimum_velocity'], tmp_path / 'motion.png')
    assert (tmp_path / 'motion.png').stat().st_size > 10_000


def test_limits_are_kept_where_they_are_asked_for() -> None:
    task = load_task('rectangle')
    (effort,) = compare(
        ['minimum_velocity'], task, T=T, limits=('position', 'velocity', 'acceleration')
    ).efforts.values()
    assert effort.finished
    assert effort.violation == ''


def test_an_arm_from_a_urdf_has_an_effort_and_an_elbow() -> None:
    named = find_arm('iiwa7')
    model = RobotModel.from_urdf(named.urdf, 'tool0')
    task = task_for(model.arm, 'arm.urdf')
    (effort,) = compare(['minimum_acceleration'], task, T=T, model=model).efforts.values()
    assert effort.elbow > 0.0
    assert np.isfinite(list(vars(effort).values())[:7]).all()


def test_what_is_unknown_is_refused() -> None:
    with pytest.raises(redres_ros.RedresError, match='fastest'):
        compare(['fastest'], 'side_to_side')


def test_a_law_and_a_limit_alone_need_no_brackets() -> None:
    found = compare('minimum_velocity', load_task('planar4r_hexagon'), T=0.05, limits='velocity')
    assert list(found.recordings) == ['minimum_velocity']


def test_nothing_to_compare_or_to_draw_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ArrayError, match='laws is empty'):
        compare([])
    with pytest.raises(ArrayError, match='no motion to draw'):
        plot({})
    with pytest.raises(FileError, match='cannot read no_such.yaml'):
        compare(['minimum_velocity'], Path('no_such.yaml'))
    found = compare(['minimum_velocity'], 'planar4r_hexagon', T=0.1)
    with pytest.raises(
        FileError, match="cannot write .*picture.xyz: Format 'xyz' is not supported"
    ):
        plot(found, tmp_path / 'picture.xyz')
