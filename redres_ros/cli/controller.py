"""Builds the controller from the options: a law, preferences, tasks and limits."""

import argparse
import os
from typing import TYPE_CHECKING, Any

from redres_ros.cli.gains import gains_of, given_gains
from redres_ros.cli.parser import NONE, OptionError
from redres_ros.errors import UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from redres_ros.cli.task import WantedMotion
    from redres_ros.controller import Controller
    from redres_ros.laws import Law
    from redres_ros.limits import Limit
    from redres_ros.preferences import Preference
    from redres_ros.robot_model import RobotModel
    from redres_ros.tasks import Task


def find_law(options: argparse.Namespace, name: str, damping: float | None = None) -> 'Law':
    """The law of that name.

    Args:
        options: With its gains.
        name: In the table of laws.
        damping: Of this law alone [1/s]; None: that of the options.

    Raises:
        UnknownNameError: No such law.
        RangeError: A gain out of its range.
    """
    from redres_ros.laws import make_law

    gains = gains_of(options, 'law', name)
    if damping is None:
        damping = options.damping
    if damping is not None:
        gains['damping'] = damping
    return make_law(name, **gains)


def make_controller(
    options: argparse.Namespace,
    motion: 'WantedMotion',
    law: 'Law',
    T: float,
    *,
    switch_time: float = 0.0,
) -> 'Controller':
    """The controller of the options.

    Args:
        options: The command line.
        motion: The arm and its task.
        law: The law in force.
        T: Sampling time [s].
        switch_time: Over which the start is blended [s].

    Raises:
        RedresError: A value that is not allowed.
    """
    from redres_ros.controller import Controller

    return Controller(
        motion.model,
        law,
        T,
        task=motion.task_space,
        switch_time=switch_time,
        limits=find_limits(options, motion.model),
        limit_scale=options.limit_scale,
        torque_scale=options.torque_scale,
        preferences=find_preferences(options),
        secondary_tasks=find_secondary_tasks(options),
        scaling=options.scaling or 'task',
    )


def find_limits(options: argparse.Namespace, model: 'RobotModel') -> 'tuple[Limit, ...]':
    """The limits that are to be kept.

    Args:
        options: The command line.
        model: Of the arm.

    Raises:
        RedresError: A name or a figure is wrong.
    """
    names = limit_names(options)
    if not names:
        _check_scales(options, {})
        return ()
    from redres_ros.limits import LIMITS, make_limits

    _check_scales(options, {name: LIMITS[name] for name in names if name in LIMITS})
    gains = {
        gain.key: value for gain, value in given_gains(options).items() if gain.kind == 'limit'
    }
    return tuple(
        make_limits(
            names,
            model,
            limit_scale=options.limit_scale,
            torque_scale=options.torque_scale,
            gains=gains,
        )
    )


def _check_scales(options: argparse.Namespace, limits: 'Mapping[str, type[Limit]]') -> None:
    """Refuse a scale of limits that are not in use."""
    for name in ('limit_scale', 'torque_scale'):
        scale = getattr(options, name)
        if scale != 1.0 and all(limit.scaled_by != name for limit in limits.values()):
            option = name.replace('_', '-')
            of = 'the limit torque' if name == 'torque_scale' and limits else 'limits'
            used = ', '.join(limits) or NONE
            raise OptionError(f'--{option} {scale:g} acts on {of}; in use: {used}, see --limits')
    if options.scaling == 'components' and not limits:
        raise OptionError(f'--scaling components acts on limits; in use: {NONE}')


def find_preferences(options: argparse.Namespace) -> 'tuple[Preference, ...]':
    """The preferences with their gains. Raises RedresError for a name or a gain that is wrong."""
    from redres_ros.parameter import check_once
    from redres_ros.preferences import make_preference

    check_once('preference', (text.partition('=')[0] for text in options.prefer or ()))
    preferences = []
    for text in options.prefer or ():
        name, equals, own = text.partition('=')
        gains = gains_of(options, 'preference', name)
        if equals:
            gains['gain'] = _number(text, own)
        preferences.append(make_preference(name, **gains))
    return tuple(preferences)


def find_secondary_tasks(options: argparse.Namespace) -> 'tuple[str | Task, ...]':
    """The secondary tasks; one without a target keeps its initial value."""
    from redres_ros.parameter import check_once
    from redres_ros.tasks import make_task

    check_once('task', options.secondary or ())
    tasks: list[str | Task] = []
    for name in options.secondary or ():
        gains = gains_of(options, 'task', name)
        tasks.append(make_task(name, **{'target': (), **gains}) if gains else name)
    return tuple(tasks)


def limit_names(options: argparse.Namespace) -> tuple[str, ...]:
    """The names in --limits; empty for none. Raises RedresError for one that is not allowed."""
    if options.limits == NONE:
        return ()
    from redres_ros.limits import LIMITS
    from redres_ros.parameter import check_once

    names = tuple(name.strip() for name in options.limits.split(','))
    if NONE in names:
        raise OptionError(f'--limits {options.limits}; expected names, or {NONE} alone')
    check_once('limit', names)
    for name in names:
        if name not in LIMITS:
            raise UnknownNameError('limit', name, [*LIMITS, NONE])
    return names


def in_use(options: argparse.Namespace, *laws: str) -> set[tuple[str, str]]:
    """Kind and name of the laws, preferences and tasks in use.

    Args:
        options: The command line.
        *laws: Names of the laws.
    """
    used = {('law', law) for law in laws}
    used |= {('limit', name) for name in limit_names(options)}
    used |= {('preference', text.partition('=')[0]) for text in options.prefer or ()}
    return used | {('task', name) for name in options.secondary or ()}


def node_parameters(options: argparse.Namespace, motion: 'WantedMotion') -> dict[str, Any]:
    """Parameters of the nodes beside the law, its damping, the robot and its dynamics.

    Args:
        options: The command line.
        motion: The arm and its task.

    Raises:
        OptionError: A target that is open by default: ROS has no parameters for such ones.
    """
    parameters: dict[str, Any] = {}
    for gain, value in given_gains(options).items():
        if gain.default == ():
            raise OptionError(f'--{gain.key} cannot be set on nodes, which take the start for it')
        parameters[gain.key] = value
    preferences = []
    for preference in options.prefer or ():
        name, equals, own = preference.partition('=')
        preferences.append(name)
        if equals:
            parameters[f'{name}.gain'] = _number(preference, own)
    # ROS takes an empty array for no value at all.
    parameters['limits'] = limit_names(options) or (NONE,)
    parameters['preferences'] = tuple(preferences) or (NONE,)
    parameters['secondary_tasks'] = tuple(options.secondary or ()) or (NONE,)
    parameters['task_space'] = motion.task_space
    parameters['plugins'] = tuple(map(os.path.abspath, options.plugin or ())) or (NONE,)
    parameters['limit_scale'] = options.limit_scale
    parameters['torque_scale'] = options.torque_scale
    if options.scaling:
        parameters['scaling'] = options.scaling
    if options.tip:
        parameters['tip_frame'] = options.tip
    if options.elbow:
        parameters['elbow_frame'] = options.elbow
    return parameters


def _number(option: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise OptionError(f'--prefer {option}; expected NAME=GAIN, as joint_centering=4') from None
