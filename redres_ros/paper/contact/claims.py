"""What the package promises about contact, measured. `redres reproduce contact` prints it."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from redres_ros.contact import Admittance, AdmittanceSettings, ContactControl, minimum_damping
from redres_ros.contact.contact_control import ContactError
from redres_ros.controller import Controller
from redres_ros.errors import RangeError
from redres_ros.laws import Law, make_law
from redres_ros.paper.claims.claim import CONTACT, ROUNDING, Claim, Finding, claim
from redres_ros.paper.contact.pushed import (
    FORCE_CONTROL,
    IMPEDANCE,
    STEP,
    STIFFNESS,
    analytic,
    by_velocity,
    pushed_tip,
    stepped,
    wall_below,
)
from redres_ros.paper.contact.scenes import (
    COMPLIANCE,
    FORCE,
    LAW,
    LIMITS,
    Pressing,
    elbow_pushed,
    pressed,
)
from redres_ros.paper.contact.second_order import by_scheme, by_torques
from redres_ros.paper.runs import Runs
from redres_ros.preferences import Compliance
from redres_ros.robot_model import RobotModel

ARMS = ('fr3', 'iiwa7', 'lwr4', 'gen3')
# Gains k of the compliance by torque law, whose weight is M^p with p = 0, 1, 2, and arm.
TORQUE_LAWS = {
    'minimum_weighted_torque': {'fr3': 1.0, 'iiwa7': 1.0, 'lwr4': 1.0, 'gen3': 1.0},
    'dynamically_consistent': {'fr3': 0.15, 'iiwa7': 0.15, 'lwr4': 3.0, 'gen3': 0.05},
    'minimum_torque': {'fr3': 0.03, 'iiwa7': 0.01, 'lwr4': 10.0, 'gen3': 0.02},
}
_T = 0.002  # [s]
_LEAST_GIVE = 0.03  # [m] of the elbow
_FRACTION_LEFT = 0.15  # of it, six seconds later


def same_as_scheme(law: str) -> Finding:
    """Impedance and force control by a law and by its scheme, in the ideal loop."""
    differences = []
    for settings, force in ((IMPEDANCE, pushed_tip), (FORCE_CONTROL, wall_below)):
        apart = by_velocity(law, settings, force).dq - by_scheme(law, settings, force).dq
        differences.append(float(np.linalg.norm(apart, axis=1).max()))
    free, on_table = differences
    return Finding(
        max(differences) <= ROUNDING,
        f'largest |dq_I - dq_II| {free:.1e} rad/s (impedance), '
        f'{on_table:.1e} rad/s (20 N on a table of 10 kN/m)',
    )


def _level_claim(law: str, says: str) -> Claim:
    """That a law and its scheme are the same while a hand pushes tip and elbow."""
    return Claim('level', says, lambda runs: same_as_scheme(law), CONTACT)


@claim(
    'level',
    'On the plant, impedance through positions differs from impedance by torques by no more than '
    'the servos give way to the push, and what the tip moves in three cycles',
    CONTACT,
)
def on_plant(runs: Runs) -> Finding:
    """A push of 20 N on the tip, servos of 100 and 400 rad/s, the same arm by torques."""
    law = 'dynamically_consistent'
    torques = by_torques(law, IMPEDANCE, pushed_tip)
    speed = float(np.linalg.norm(np.diff(torques.x, axis=0), axis=1).max())  # [m] in a cycle
    held = True
    found = []
    for bandwidth in (100.0, 400.0):
        yielding, still = (
            by_velocity(law, IMPEDANCE, pushed_tip, bandwidth, elbow_push=0.0, felt=felt)
            for felt in (1.0, 0.0)
        )
        difference = float(np.linalg.norm(yielding.x - torques.x, axis=1).max())
        held = held and difference <= still.distance + 3.0 * speed
        found.append(
            f'{1e3 * difference:.2f} mm with servos of {bandwidth:g} rad/s, which give way by '
            f'{1e3 * still.distance:.2f} mm'
        )
    return Finding(
        held, f'of {1e3 * torques.distance:.1f} mm the tips differ by ' + ', '.join(found)
    )


@claim(
    'step',
    'A step of force is answered within 2 % as by the analytic mass, damper and spring',
    CONTACT,
)
def step_response(runs: Runs) -> Finding:
    """4 kg, 40 N s/m, 400 N/m and 10 N in the ideal loop and on the plant.

    The servos give way to the force by what is measured without the admittance. What is left is
    their lag: the wrench acts on the plant in a cycle, and on the reference after it.
    """
    end = STEP / STIFFNESS
    ideal = stepped()
    deviation = float(np.abs(ideal - analytic()).max()) / end
    found = []
    unexplained = []
    deflections = []
    for bandwidth in (100.0, 400.0):
        moved = stepped(bandwidth)
        deflection = stepped(bandwidth, felt=0.0)
        error = float(np.abs(moved - analytic()).max()) / end
        found.append(f'{error:.1%} behind servos of {bandwidth:g} rad/s')
        unexplained.append(float(np.abs(moved - ideal - deflection).max()) / end)
        deflections.append(f'{float(np.abs(deflection).max()) / end:.2%}')
    return Finding(
        deviation < 0.02 and max(unexplained) < 0.002,
        f'largest deviation {deviation:.1%} in the ideal loop, on the plant ' + ', '.join(found),
        f'the servos give way to the force itself by {" and ".join(deflections)}; beside that the '
        f'plant differs from the ideal loop by {max(unexplained):.2%}',
    )


def _press_claim(says: str, rms: float, *cases: Pressing) -> Claim:
    """That the tip presses and slides without a bounce, with a force error of at most rms [N]."""

    def measure(runs: Runs) -> Finding:
        held = True
        found = []
        for case in cases:
            run = pressed(case)
            stays = bool((run.force[run.first :] > 0.0).all())
            held = held and stays and run.rms <= rms and run.force.max() <= 25.0
            found.append(
                f'{1e-3 * case.stiffness:g} kN/m, {case.damping:g} N s/m: RMS {run.rms:.3f} N, '
                f'peak {run.force.max():.1f} N' + ('' if stays else ', bounces')
            )
        return Finding(held, '; '.join(found))

    return Claim('press', says, measure, CONTACT)


def _yields(
    arm: str, presses: bool, law: Law = LAW, compliance: Compliance = COMPLIANCE
) -> tuple[bool, str]:
    """Whether an elbow that is pushed yields as promised, and figures; arguments as of
    elbow_pushed().
    """
    run = elbow_pushed(arm, presses, law, compliance)
    give = float(run.elbow.max())
    comes_back = abs(run.elbow[-1]) < _FRACTION_LEFT * give
    shown = f'gives {1e3 * give:.0f} mm, {1e3 * run.elbow[-1]:.0f} mm left'
    if not presses:
        apart = float(np.linalg.norm(run.tip, axis=1).max())
        return give >= _LEAST_GIVE and apart < 2e-4, f'{shown}, tip {1e3 * apart:.2f} mm'
    along = float(np.linalg.norm(run.tip[:, :2], axis=1).max())
    held = give >= _LEAST_GIVE and comes_back and run.rms < 0.05 and along < 4e-4
    return held, f'{shown}, RMS {run.rms:.3f} N, tip {1e3 * along:.2f} mm'


def _elbow_claim(says: str, **cases: tuple[Any, ...]) -> Claim:
    """That an elbow yields; cases: arguments of _yields(), by what the tip does."""

    def measure(runs: Runs) -> Finding:
        found = {name: _yields(*case) for name, case in cases.items()}
        shown = [f'{name}: {text}' if len(cases) > 1 else text for name, (_, text) in found.items()]
        return Finding(all(held for held, _ in found.values()), '; '.join(shown))

    return Claim('elbow', says, measure, CONTACT)


def _elbow_claims() -> Iterator[Claim]:
    """With law (23) in contact and in free space, and with each law that minimises torques beside
    the arm's weight in contact.
    """
    for arm in ARMS:
        says = (
            f'{arm}: 30 N on the elbow for a second while the tip presses 20 N: it gives 30 mm and '
            'comes back, RMS below 0.05 N, tip within 0.4 mm; in free space within 0.2 mm'
        )
        yield _elbow_claim(says, pressing=(arm, True), free=(arm, False))
    for power, (law, gains) in enumerate(TORQUE_LAWS.items()):
        carrying = make_law(law, damping=10.0, gravity=0.0)
        for arm, gain in gains.items():
            says = f'{arm}, {law}: pressing, the same with gravity 0, inertia_power {power}, '
            compliance = Compliance(gain=gain, inertia_power=power)
            yield _elbow_claim(f'{says}gain {gain:g}', pressing=(arm, True, carrying, compliance))


def _gravity_claim(law: str) -> Claim:
    """That gravity, if a law minimises it, moves the elbow without any push."""

    def measure(runs: Runs) -> Finding:
        heavy = elbow_pushed('fr3', True, make_law(law, damping=10.0), push=0.0)
        fall = float(np.abs(heavy.elbow).max())
        return Finding(
            fall > _FRACTION_LEFT * _LEAST_GIVE, f'the elbow moves by {1e3 * fall:.0f} mm'
        )

    says = f'fr3, {law} with gravity 1, no push: gravity is a motion of the null space, Eq. (A.14)'
    return Claim('elbow', says, measure, CONTACT)


@claim(
    'elbow', 'fr3: laws without velocity history take no preference: no null-space motion', CONTACT
)
def without_history(runs: Runs) -> Finding:
    """The servos alone give way."""
    found = []
    for law in ('minimum_velocity', 'minimum_kinetic_energy'):
        give = float(elbow_pushed('fr3', True, make_law(law)).elbow.max())
        found.append((law, give))
    return Finding(
        all(give < 0.1 * _LEAST_GIVE for _, give in found),
        ', '.join(f'{law} gives {1e3 * give:.1f} mm' for law, give in found),
    )


@claim(
    'bound',
    'A damping below k (n T + 2/w) / 1.5 is refused with that figure; at the bound the tip comes '
    'to rest on the surface',
    CONTACT,
)
def bound(runs: Runs) -> Finding:
    """100 kN/m behind 1, 5 and 10 cycles of 2 ms, servos of 400 rad/s."""
    found = []
    held = True
    for delay in (1, 5, 10):
        least = minimum_damping(1e5, _T, delay=delay, bandwidth=400.0)
        contact = AdmittanceSettings(
            contact_stiffness=1e5, contact_delay=delay, servo_bandwidth=400.0
        )
        refused = ''
        try:
            Admittance(replace(contact, damping=(0.99 * least,) * 3), _T)
        except RangeError as error:
            refused = str(error)
        case = Pressing(T=_T, stiffness=1e5, damping=least, delay=delay)
        force = pressed(case, distance=0.01).force
        ripple = float(np.ptp(force[-round(0.2 / _T) :]))
        held = held and f'{np.ceil(least):.0f}' in refused and ripple < 1.0
        found.append(f'{least:.0f} N s/m behind {delay} cycles: ripple {ripple:.1g} N')
    return Finding(held, ', '.join(found))


@claim(
    'safety',
    'A wrench that is stale, not finite or saturated ends the motion; a high force makes the tip '
    'retreat 10 mm; a search for contact ends after 50 mm',
    CONTACT,
)
def reactions(runs: Runs) -> Finding:
    """In the ideal loop, each for itself."""
    push = np.array((0.0, 10.0, 0.0, 0.0, 0.0, 0.0))
    pressing = (0.0, 0.0, FORCE)
    reasons: dict[str, tuple[np.ndarray | None, dict[str, Any]]] = {
        'no wrench for': (None, {}),
        'finite values': (np.full(6, np.nan), {}),
        'saturated': (6.0 * push, {'sensor_range': 50.0}),
        'has retreated': (20.0 * push, {}),
        'no contact within': (0.0 * push, {'force': pressing}),
    }
    held = True
    found = []
    for words, (wrench, given) in reasons.items():
        settings = AdmittanceSettings(enabled=True, damping=(500.0,) * 3, **given)
        moved, reason = _until_it_ends(settings, push, wrench)
        held = held and words in reason
        found.append(f'{words}: {1e3 * moved:.1f} mm')
    return Finding(held, 'the tip moves on by: ' + ', '.join(found))


def _until_it_ends(
    settings: AdmittanceSettings, first: np.ndarray, wrench: np.ndarray | None
) -> tuple[float, str]:
    """How far the tip moves [m] until the motion ends, and why it does: with one wrench (6,) for
    0.1 s, and then another; None: none comes.
    """
    model = RobotModel.named('fr3')
    controller = Controller(model, make_law('minimum_acceleration'), _T, limits=LIMITS)
    contact = ContactControl(settings, _T)
    q = np.array(model.arm.start)
    x0 = model.tip(q)[0]
    for k in range(round(10.0 / _T)):
        state = model.state(q, np.zeros(model.n))
        measured = first if k < 0.1 / _T else wrench
        if k == round(0.1 / _T):
            x0 = state.x
        if measured is not None:
            contact.sensor.enter(measured, model.base_frame)
        try:
            velocity = contact.velocity(np.zeros(3), state)
        except ContactError as error:
            return float(np.linalg.norm(state.x - x0)), str(error)
        command = controller.update(q, velocity)
        contact.record(command, np.zeros(3))
        q = command.q_ref
    return float(np.linalg.norm(model.tip(q)[0] - x0)), ''


@claim('safety', 'No wrench makes a joint leave its limits', CONTACT)
def keeps_limits(runs: Runs) -> Finding:
    """Random forces of up to a million newtons on three arms, a thousand ticks each."""
    usages = {}
    for arm in ARMS[:3]:
        model = RobotModel.named(arm)
        controller = Controller(model, make_law('minimum_acceleration'), _T, limits=LIMITS)
        settings = AdmittanceSettings(enabled=True, damping=(10.0,) * 3)
        admittance = Admittance(settings, _T)
        random = np.random.default_rng(0)
        q = np.array(model.arm.start)
        dq = np.zeros(model.n)
        acceleration = np.array(model.arm.acceleration_limit)
        usage = 0.0
        for _ in range(1000):
            wrench = 10.0 ** random.uniform(0.0, 6.0) * random.normal(size=6)
            state = model.state(q, dq)
            command = controller.update(q, admittance.velocity(np.zeros(3), wrench, state))
            admittance.record(command, np.zeros(3))
            ddq = (command.dq - dq) / _T
            usage = max(usage, float(np.abs(command.dq / model.dq_max).max()))
            usage = max(usage, float(np.abs(ddq / acceleration).max()))
            q = command.q_ref
            dq = command.dq
            if not ((model.q_min <= q) & (q <= model.q_max)).all():
                usage = np.inf
        usages[arm] = usage
    return Finding(
        max(usages.values()) <= 1.0 + 1e-9,
        'largest share of a limit: ' + ', '.join(f'{arm} {v:.4f}' for arm, v in usages.items()),
    )


CONTACT_CLAIMS: tuple[Claim, ...] = (
    _level_claim(
        'minimum_acceleration',
        'The admittance with law (23) is impedance and force control on the acceleration level, '
        '(22)',
    ),
    _level_claim(
        'dynamically_consistent',
        'With law (32) it is that on the torque level, with a dynamically consistent null space, '
        '(29)',
    ),
    _level_claim(
        'minimum_weighted_torque',
        'With law (27) it is that with the torque of least norm M^-2, (25)',
    ),
    on_plant,
    step_response,
    _press_claim(
        'Pressing 20 N and sliding 0.3 m at 50 mm/s: RMS at most 0.02 N, peak at most 25 N, no '
        'bounce',
        0.02,
        Pressing(stiffness=1e4),
        Pressing(stiffness=1e5),
    ),
    _press_claim(
        'The same with 1 N of noise: RMS at most 0.2 N',
        0.2,
        Pressing(stiffness=1e4, noise=1.0),
        Pressing(stiffness=1e5, damping=3000.0, noise=1.0),
    ),
    *_elbow_claims(),
    *map(_gravity_claim, TORQUE_LAWS),
    without_history,
    bound,
    reactions,
    keeps_limits,
)
