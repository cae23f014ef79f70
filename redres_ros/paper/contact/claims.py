"""What the package promises about contact, measured. `redres reproduce contact` prints it."""

from dataclasses import replace
from typing import Any

import numpy as np

from redres_ros.contact import Admittance, AdmittanceSettings, ContactControl, minimum_damping
from redres_ros.contact.contact_control import ContactError
from redres_ros.controller import Controller
from redres_ros.errors import RangeError
from redres_ros.laws import make_law
from redres_ros.paper.claims.claim import CONTACT, ROUNDING, Claim, Finding, claim
from redres_ros.paper.contact.scenes import (
    FORCE,
    LIMITS,
    Pressed,
    Pressing,
    Yielding,
    elbow_pushed,
    pressed,
)
from redres_ros.paper.contact.second_order import (
    FORCE_CONTROL,
    IMPEDANCE,
    by_scheme,
    by_velocity,
    on_plant_by_positions,
    on_plant_by_torques,
    pushed_tip,
    servo_deflection,
    wall_below,
)
from redres_ros.paper.contact.step_response import analytic, in_the_ideal_loop, on_plant_after
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
_STIFFNESSES = (1e4, 1e5)  # [N/m]
_LEAST_GIVE = 0.03  # [m] of the elbow
_SHARE_LEFT = 0.15  # of it, six seconds later


def same_as_scheme(law: str) -> Finding:
    """Impedance and force control by a law and by its scheme, in the ideal loop.

    Args:
        law: Its name.
    """
    differences = {}
    for name, settings, force in (
        ('impedance', IMPEDANCE, pushed_tip),
        ('20 N on a table of 10 kN/m', FORCE_CONTROL, wall_below),
    ):
        one = by_velocity(law, settings, force)
        two = by_scheme(law, settings, force)
        differences[name] = float(np.linalg.norm(one.dq - two.dq, axis=1).max())
    return Finding(
        max(differences.values()) <= ROUNDING,
        'largest |dq_I - dq_II| '
        + ', '.join(f'{value:.1e} rad/s ({name})' for name, value in differences.items()),
    )


@claim(
    'level',
    'The admittance with law (23) is impedance and force control on the acceleration level, (22)',
    CONTACT,
)
def on_acceleration_level(runs: Runs) -> Finding:
    """A hand pushes tip and elbow."""
    return same_as_scheme('minimum_acceleration')


@claim(
    'level',
    'With law (32) it is that on the torque level, with a dynamically consistent null space, (29)',
    CONTACT,
)
def on_torque_level(runs: Runs) -> Finding:
    """A hand pushes tip and elbow; the elbow yields through tau_N."""
    return same_as_scheme('dynamically_consistent')


@claim('level', 'With law (27) it is that with the torque of least norm M^-2, (25)', CONTACT)
def with_weighted_torque(runs: Runs) -> Finding:
    """A hand pushes tip and elbow."""
    return same_as_scheme('minimum_weighted_torque')


@claim(
    'level',
    'On the plant, impedance through positions differs from impedance by torques by no more than '
    'the servos give way to the push, and what the tip moves in three cycles',
    CONTACT,
)
def on_plant(runs: Runs) -> Finding:
    """A push of 20 N on the tip, servos of 100 and 400 rad/s, the same arm by torques."""
    law = 'dynamically_consistent'
    by_torques = on_plant_by_torques(law)
    speed = float(np.linalg.norm(np.diff(by_torques.x, axis=0), axis=1).max())  # [m] in a cycle
    held = True
    found = []
    for bandwidth in (100.0, 400.0):
        by_positions = on_plant_by_positions(law, bandwidth)
        difference = float(np.linalg.norm(by_positions.x - by_torques.x, axis=1).max())
        deflection = servo_deflection(bandwidth)
        held = held and difference <= deflection + 3.0 * speed
        found.append(
            f'{1e3 * difference:.2f} mm with servos of {bandwidth:g} rad/s, which give way by '
            f'{1e3 * deflection:.2f} mm'
        )
    moved = float(np.linalg.norm(by_torques.x - by_torques.x[0], axis=1).max())
    return Finding(held, f'of {1e3 * moved:.1f} mm the tips differ by ' + ', '.join(found))


@claim(
    'step',
    'A step of force is answered within 2 % as by the analytic mass, damper and spring',
    CONTACT,
)
def step_response(runs: Runs) -> Finding:
    """4 kg, 40 N s/m, 400 N/m and 10 N in the ideal loop and on the plant."""
    end = float(analytic(np.array((1e3,)))[0])
    ideal = float(np.abs(in_the_ideal_loop() - analytic()).max()) / end
    found = []
    explained = []
    deflections = []
    for bandwidth in (100.0, 400.0):
        response = on_plant_after(bandwidth)
        found.append(f'{response.error / end:.1%} behind servos of {bandwidth:g} rad/s')
        explained.append(response.unexplained / end)
        deflections.append(f'{response.deflection / end:.2%}')
    return Finding(
        ideal < 0.02 and max(explained) < 0.002,
        f'largest deviation {ideal:.1%} in the ideal loop, on the plant ' + ', '.join(found),
        f'the servos give way to the force itself by {" and ".join(deflections)}; beside that the '
        f'plant differs from the ideal loop by {max(explained):.2%}',
    )


def _pressing(cases: list[Pressing], rms: float) -> Finding:
    """Pressing and sliding.

    Args:
        cases: Surfaces and dampings.
        rms: Largest error of the force [N].
    """
    held = True
    found = []
    for case in cases:
        run: Pressed = pressed(case)
        stays = bool((run.force[run.first :] > 0.0).all())
        held = held and stays and run.rms <= rms and run.force.max() <= 25.0
        found.append(
            f'{1e-3 * case.stiffness:g} kN/m, {case.damping:g} N s/m: RMS {run.rms:.3f} N, peak '
            f'{run.force.max():.1f} N' + ('' if stays else ', bounces')
        )
    return Finding(held, '; '.join(found))


@claim(
    'press',
    'Pressing 20 N and sliding 0.3 m at 50 mm/s: RMS at most 0.02 N, peak at most 25 N, no bounce',
    CONTACT,
)
def presses(runs: Runs) -> Finding:
    """The FR3 with an ideal sensor."""
    return _pressing([Pressing(stiffness=stiffness) for stiffness in _STIFFNESSES], 0.02)


@claim('press', 'The same with 1 N of noise: RMS at most 0.2 N', CONTACT)
def presses_with_noise(runs: Runs) -> Finding:
    """The FR3 with a sensor like a real one."""
    cases = [
        Pressing(stiffness=1e4, noise=1.0),
        Pressing(stiffness=1e5, damping=3000.0, noise=1.0),
    ]
    return _pressing(cases, 0.2)


def _yields(run: Yielding, presses: bool) -> tuple[bool, str]:
    """Whether the elbow yields as promised, and figures.

    Args:
        run: Of an elbow that is pushed.
        presses: Whether on a table.
    """
    give = float(run.elbow.max())
    comes_back = abs(run.elbow[-1]) < _SHARE_LEFT * give
    shown = f'gives {1e3 * give:.0f} mm, {1e3 * run.elbow[-1]:.0f} mm left'
    if not presses:
        apart = float(np.linalg.norm(run.tip, axis=1).max())
        return give >= _LEAST_GIVE and apart < 2e-4, f'{shown}, tip {1e3 * apart:.2f} mm'
    along = float(np.linalg.norm(run.tip[:, :2], axis=1).max())
    held = give >= _LEAST_GIVE and comes_back and run.rms < 0.05 and along < 4e-4
    return held, f'{shown}, RMS {run.rms:.3f} N, tip {1e3 * along:.2f} mm'


def elbow_claim(arm: str) -> Claim:
    """That its elbow yields with law (23), in contact and in free space."""

    def measure(runs: Runs) -> Finding:
        on_table, shown = _yields(elbow_pushed(arm, presses=True), presses=True)
        free, shown_free = _yields(elbow_pushed(arm, presses=False), presses=False)
        return Finding(on_table and free, f'pressing: {shown}; free: {shown_free}')

    says = (
        f'{arm}: 30 N on the elbow for a second while the tip presses 20 N: it gives 30 mm and '
        'comes back, RMS below 0.05 N, tip within 0.4 mm; in free space within 0.2 mm'
    )
    return Claim('elbow', says, measure, CONTACT)


def law_claim(law: str, arm: str) -> Claim:
    """That the elbow yields with a law that minimises torques beside the arm's weight.

    Args:
        law: Its name.
        arm: Its name.
    """
    power = list(TORQUE_LAWS).index(law)
    gain = TORQUE_LAWS[law][arm]

    def measure(runs: Runs) -> Finding:
        carrying = make_law(law, damping=10.0, gravity=0.0)
        compliance = Compliance(gain=gain, inertia_power=power)
        held, shown = _yields(elbow_pushed(arm, True, carrying, compliance), presses=True)
        return Finding(held, shown)

    says = f'{arm}, {law}: pressing, the same with gravity 0, inertia_power {power}, gain {gain:g}'
    return Claim('elbow', says, measure, CONTACT)


def gravity_claim(law: str) -> Claim:
    """That gravity, if a law minimises it, moves the elbow without any push."""

    def measure(runs: Runs) -> Finding:
        heavy = elbow_pushed('fr3', True, make_law(law, damping=10.0), push=0.0)
        fall = float(np.abs(heavy.elbow).max())
        return Finding(fall > _SHARE_LEFT * _LEAST_GIVE, f'the elbow moves by {1e3 * fall:.0f} mm')

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
        case = Pressing(T=_T, stiffness=1e5, damping=least, delay=delay, distance=0.01)
        force = pressed(case).force
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
    """How far the tip moves [m] until the motion ends, and why it does.

    Args:
        settings: Of the admittance.
        first: Wrench of the first 0.1 s, (6,).
        wrench: That of the next 10 s, (6,); None: none comes.
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
    on_acceleration_level,
    on_torque_level,
    with_weighted_torque,
    on_plant,
    step_response,
    presses,
    presses_with_noise,
    *(elbow_claim(arm) for arm in ARMS),
    *(law_claim(law, arm) for law in TORQUE_LAWS for arm in ARMS),
    *(gravity_claim(law) for law in TORQUE_LAWS),
    without_history,
    bound,
    reactions,
    keeps_limits,
)
