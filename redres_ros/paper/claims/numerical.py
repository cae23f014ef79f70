"""Claims of Sections 3.2 to 5: simulations with an ideal arm."""

from itertools import product

from redres_ros.paper.claims.claim import ROUNDING, Finding, claim, same_velocities
from redres_ros.paper.equivalence import SIMULATION_DYNAMICS, velocity_difference
from redres_ros.paper.runs import (
    EXPERIMENT_DYNAMICS,
    SIMULATION_DAMPING,
    SIMULATION_T,
    TORQUE_LAWS,
    Runs,
    two_rounds,
)
from redres_ros.simulation.recording import Recording


@claim(
    '3.2',
    'Without damping the joints float on the self-motion manifold; null-space damping removes that',
)
def _drift(runs: Runs) -> Finding:
    tick = round(runs.task.segment_time / SIMULATION_T) - 1
    without, damped = (
        float(run['null_velocity_norm'][tick])
        for run in (runs['simulated_15'], runs['simulated_23'])
    )
    return Finding(
        without > 10.0 * damped,
        f'with the tip at rest after {runs.task.segment_time:g} s the joints float at '
        f'{without:.3g} rad/s, with damping at {damped:.2g} rad/s',
    )


@claim(
    '4.1',
    'With the norm weighted by M^-2 the motion stays bounded in longer tasks, '
    'unlike with the plain torque norm',
)
def _bounded(runs: Runs) -> Finding:
    weighted: list[float] = []
    plain: list[float] = []
    listed = []
    for dynamics, (law, speeds), damping in product(
        (EXPERIMENT_DYNAMICS, SIMULATION_DYNAMICS),
        {'minimum_weighted_torque': weighted, 'minimum_torque': plain}.items(),
        (0.0, SIMULATION_DAMPING),
    ):
        speed, _ = runs[two_rounds(law, damping, dynamics)].peak('joint_velocity_norm')
        speeds.append(speed)
        listed.append(f'{dynamics}, {law}, k_d = {damping:g}: {speed:.3g}')
    return Finding(
        all(one < two for one, two in zip(weighted, plain, strict=True)) and max(weighted) < 100.0,
        f'largest |dq| over two rounds of the rectangle [rad/s]: {"; ".join(listed)}',
        'bounded where the model is the identified one; '
        'with the cylinder model and no damping either norm diverges',
    )


@claim('5.1', 'Law (23) and scheme (22) give the same velocities up to rounding (Fig. 5)')
def _equivalence_damped(runs: Runs) -> Finding:
    return _equivalence(runs['simulated_23'], runs['simulated_22'])


@claim(
    '5.1',
    'Without damping the arm drifts to a singular configuration, '
    'and the acceleration peaks rise 40 times',
)
def _peaks(runs: Runs) -> Finding:
    """Ratio of the acceleration peaks of lambda = 1 and 0.99, at the sampling times of simulation
    and experiment.
    """
    names = ('simulated_15', 'simulated_23', 'ideal_15', 'ideal_23')
    found = [runs[name].peak('joint_acceleration_norm') for name in names]
    (without, at), (damped, _), (without_slower, _), (damped_slower, _) = found
    ratio = without / damped
    slower = without_slower / damped_slower
    return Finding(
        min(ratio, slower) > 10.0,
        f'{without:.1f} rad/s^2 at {at:.2f} s against {damped:.2f} rad/s^2: '
        f'{ratio:.0f} times at 1 ms; {slower:.0f} times at 2 ms',
        'the paper says 40; held means by more than ten times, since the undamped motion depends '
        'on every detail of the arm, and the paper does not give its link lengths',
    )


@claim('5.1', 'Law and scheme still behave alike without damping')
def _equivalence_undamped(runs: Runs) -> Finding:
    found = runs['difference_15']
    return Finding(
        found.max <= ROUNDING,
        f'in closed loops of their own at most {found.max:.0e} rad/s apart, '
        f'given the same past {found.same_past.max():.0e} rad/s',
        'the undamped loop amplifies rounding',
    )


@claim('5.2', 'Law (35) moves the joints faster than law (23) (Figs. 4, 7)')
def _faster(runs: Runs) -> Finding:
    (damped, _), (law_35, _) = (
        run.peak('joint_velocity_norm') for run in (runs['simulated_23'], runs['simulated_35'])
    )
    return Finding(
        law_35 > damped, f'largest |dq| {law_35:.2f} rad/s with (35), {damped:.2f} rad/s with (23)'
    )


@claim('5.2', 'Law (35) and scheme (29) with (34) give the same velocities up to rounding (Fig. 8)')
def _equivalence_35(runs: Runs) -> Finding:
    return _equivalence(runs['simulated_35'], runs['simulated_29'])


@claim('4, A', 'So do the other torque laws and their schemes')
def _equivalence_others(runs: Runs) -> Finding:
    found = {law: runs[f'difference_{law}'] for law in TORQUE_LAWS}
    listed = ', '.join(
        f'{name} {d.max:.0e} / {d.same_past.max():.0e} rad/s' for name, d in found.items()
    )
    return Finding(
        all(d.same_past.max() <= ROUNDING for d in found.values()),
        f'largest difference in closed loops of their own / given the same past: {listed}',
        'with the identified dynamics and k_d = 10 1/s',
    )


def _equivalence(law: Recording, scheme: Recording) -> Finding:
    return same_velocities(
        float(velocity_difference(law.vectors('dq1'), scheme.vectors('dq1')).max())
    )
