"""The controller of the options, or the same as parameters of the nodes or as a case of a batch."""

import argparse
import os
from typing import TYPE_CHECKING, Any

from redres_ros.cli.gains import given_gains
from redres_ros.cli.parser import NONE, OptionError
from redres_ros.errors import UnknownNameError

if TYPE_CHECKING:
    from redres_ros.cli.task import WantedMotion
    from redres_ros.controller import Controller
    from redres_ros.laws import Law
    from redres_ros.simulation.batch import Case


def find_law(options: argparse.Namespace, name: str, damping: float | None = None) -> 'Law':
    """The law of that name.

    Args:
        options: Command line with its gains.
        name: Name of a law in LAWS.
        damping: Damping of this law alone [1/s]; None: that of the options.

    Raises:
        UnknownNameError: No such law.
        RangeError: A gain out of its range.
    """
    from redres_ros.laws import make_law

    given = given_gains(options)
    gains = {gain.name: value for gain, value in given if (gain.kind, gain.owner) == ('law', name)}
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
        limit_gains=_find_gains(options),
        **_building_blocks(options),
    )


def case_of(options: argparse.Namespace, law: 'Law') -> 'Case':
    """The case that the options of a motion describe, without its task.

    Args:
        options: The command line.
        law: The law in force.

    Raises:
        RedresError: A name or a figure that is not allowed.
    """
    from redres_ros.laws import law_name
    from redres_ros.simulation.batch import Case

    gains = _find_gains(options)
    if law.has_memory:
        gains['damping'] = law.damping
    return Case(
        options.robot or 'lwr4_paper',
        law_name(law),
        options.period,
        gains=gains,
        tip_frame=options.tip or '',
        elbow_frame=options.elbow or '',
        dynamics=options.dynamics,
        plugins=tuple(options.plugin or ()),
        **_building_blocks(options),
    )


def _building_blocks(options: argparse.Namespace) -> dict[str, Any]:
    """Limits, preferences and secondary tasks, as a Controller takes them. Raises RedresError."""
    limits = _limit_names(options)
    _check_scales(options, limits)
    return {
        'limits': limits,
        'limit_scale': options.limit_scale,
        'torque_scale': options.torque_scale,
        'preferences': tuple(_preferences(options)),
        'secondary_tasks': tuple(options.secondary or ()),
        'scaling': options.scaling or 'task',
    }


def _find_gains(options: argparse.Namespace) -> dict[str, Any]:
    """The given gains, such as {'posture.gain': 4.0}. Raises OptionError for no number."""
    gains = {gain.key: value for gain, value in given_gains(options)}
    for name, text in _preferences(options).items():
        if text is None:
            continue
        try:
            gains[f'{name.partition("@")[0]}.gain'] = float(text)
        except ValueError:
            raise OptionError(
                f'--prefer {name}={text}; expected NAME=GAIN, such as joint_centering=4'
            ) from None
    return gains


def _check_scales(options: argparse.Namespace, names: tuple[str, ...]) -> None:
    """Refuse a scale of limits that are not in use."""
    scaled_by = set()
    if names:
        from redres_ros.limits import LIMITS

        scaled_by = {LIMITS[name].scaled_by for name in names}
    for name in ('limit_scale', 'torque_scale'):
        scale = getattr(options, name)
        if scale != 1.0 and name not in scaled_by:
            option = name.replace('_', '-')
            of = 'the limit torque' if name == 'torque_scale' and names else 'limits'
            used = ', '.join(names) or NONE
            raise OptionError(f'--{option} {scale:g} acts on {of}; in use: {used}, see --limits')
    if options.scaling == 'components' and not names:
        raise OptionError(f'--scaling components acts on limits; in use: {NONE}')


def _preferences(options: argparse.Namespace) -> dict[str, str | None]:
    """The text of each preference's gain by name; None: its default. Raises RepeatedNameError."""
    from redres_ros.parameter import check_once

    given = [text.partition('=') for text in options.prefer or ()]
    check_once('preference', (name for name, _, _ in given))
    return {name: gain if equals else None for name, equals, gain in given}


def _limit_names(options: argparse.Namespace) -> tuple[str, ...]:
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
    used |= {('limit', name) for name in _limit_names(options)}
    used |= {('preference', name.partition('@')[0]) for name in _preferences(options)}
    return used | {('task', name.partition('@')[0]) for name in options.secondary or ()}


def node_parameters(options: argparse.Namespace, motion: 'WantedMotion') -> dict[str, Any]:
    """Parameters of the nodes beside the law, its damping, the robot and its dynamics.

    Args:
        options: The command line.
        motion: The arm and its task.

    Raises:
        OptionError: A target that is open by default: ROS has no parameters for such ones.
    """
    for gain, _ in given_gains(options):
        if gain.default == ():
            raise OptionError(f'--{gain.key} cannot be set on nodes, which take the start for it')
    parameters = _find_gains(options) | _building_blocks(options)
    for name in ('limits', 'preferences', 'secondary_tasks'):
        parameters[name] = parameters[name] or (NONE,)  # ROS takes an empty array for no value
    if not options.scaling:
        del parameters['scaling']
    parameters['task_space'] = motion.task_space
    parameters['plugins'] = tuple(map(os.path.abspath, options.plugin or ())) or (NONE,)
    if options.tip:
        parameters['tip_frame'] = options.tip
    return parameters
