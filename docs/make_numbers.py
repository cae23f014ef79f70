"""Writes the figures of README.md and of two pages anew, and draws their pictures.

Run it with: python docs/make_numbers.py
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from redres_ros import LAWS, Controller, Effort, Recording, RobotModel, load_task, make_law, run
from redres_ros.simulation.batch import in_parallel
from redres_ros.simulation.colours import law_colour
from redres_ros.simulation.plots import legend_below, time_panels
from redres_ros.simulation.report import progress_bar

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / 'README.md', ROOT / 'docs' / 'choosing_a_law.md', ROOT / 'docs' / 'limits.md')
PICTURES = ROOT / 'docs'

T = 0.002  # sampling time [s], that of the nodes
DAMPING = 10.0  # k_d [1/s]
DAMPINGS = (0.0, 2.0, 5.0, 8.0, 10.0, 12.0, 15.0, 20.0, 50.0, 1.0 / T)
LIMITS = ('position', 'velocity', 'acceleration')

_BLOCK = r'(<!-- numbers: {} -->\n)(.*?)(<!-- end -->)'
# k_d [1/s], and from light to dark: the shade in which each is drawn
_DRAWN_DAMPINGS = {0.0: -0.7, 2.0: -0.4, 10.0: 0.0, 20.0: 0.4, 50.0: 0.75}
_EFFORT = ('acceleration', 'velocity', 'torque', 'squared_torque', 'kinetic_energy', 'elbow')


@dataclass(frozen=True)
class Case:
    """One run of which the pages tell."""

    law: str
    task: str = 'rectangle'
    damping: float = DAMPING
    limits: tuple[str, ...] = ()
    limit_scale: float = 1.0


@dataclass(frozen=True)
class Result:
    """What came of it."""

    recording: Recording
    effort: Effort


Results = dict[Case, Result]

EFFORTS = [Case(law) for law in LAWS]
DAMPED = [Case('minimum_acceleration', damping=damping) for damping in DAMPINGS]
BOUNDED = [replace(case, limits=LIMITS) for case in DAMPED]
HALF_LIMITS = [
    Case(law, limits=LIMITS, limit_scale=0.5)
    for law in ('minimum_velocity', 'minimum_acceleration')
]


def result(case: Case) -> Result:
    """Run it."""
    task = load_task(case.task)
    model = RobotModel.named(task.robot)
    law = make_law(case.law, damping=case.damping)
    controller = Controller(model, law, T, limits=case.limits, limit_scale=case.limit_scale)
    recording = run(controller, task, greedy=False)  # as the nodes do
    return Result(recording, Effort.of(recording, model))


# --- tables ---------------------------------------------------------------------------------------


def effort_table(results: Results) -> str:
    """One row a law, on the rectangle, without limits."""
    heads = 'law | k_d [1/s] | max ‖q̈‖ [rad/s²] | max ‖q̇‖ [rad/s] | max ‖τ‖ [Nm] | '
    heads += "∫‖τ‖² [Nm² s] | ∫ energy [J s] | elbow's path [m]"
    least = {name: min(getattr(results[case].effort, name) for case in EFFORTS) for name in _EFFORT}
    rows = []
    for case in EFFORTS:
        effort = results[case].effort
        damping = f'{case.damping:g}' if LAWS[case.law].has_memory else '–'
        figures = [_figure(getattr(effort, name), least[name]) for name in _EFFORT]
        rows.append([f'`{case.law}`', damping, *figures])
    return markdown(heads, rows)


def damping_table(results: Results) -> str:
    """The largest acceleration of least acceleration on the rectangle, by damping."""
    heads = 'k_d [1/s] | ' + ' | '.join(f'{case.damping:g}' for case in DAMPED)
    peaks = [f'{results[case].effort.acceleration:.1f}' for case in DAMPED]
    kept = ['yes' if not results[case].effort.violation else 'no' for case in DAMPED]
    ends = [_end(results[case]) for case in BOUNDED]
    rows = [
        ['max ‖q̈‖ [rad/s²]', *peaks],
        ['within the limits?', *kept],
        ['end with limits on [s]', *ends],
    ]
    return markdown(heads, rows)


def headline(results: Results) -> str:
    """What README says of the laws on the rectangle."""
    model = RobotModel.named(load_task('rectangle').robot)
    velocity = usage_of(results[Case('minimum_velocity')].recording, model).max()
    acceleration = usage_of(results[Case('minimum_acceleration')].recording, model).max()
    bounded = results[Case('minimum_velocity', limits=LIMITS)].recording
    return (
        f'Near the stretched arm `minimum_velocity` asks a joint for {velocity:.1f} times the\n'
        f'acceleration that it has, `minimum_acceleration` for {acceleration:.0%} of it. Within\n'
        f'limits `minimum_velocity` finishes too, in {bounded["t"][-1]:.2f} s instead of 9.00 s.\n'
    )


def usage_of(recording: Recording, model: RobotModel) -> np.ndarray:
    """Acceleration of the joint nearest to its limit, or beyond, as a fraction of it, (ticks,)."""
    ddq = np.diff(recording.vectors('dq1'), axis=0, prepend=0.0) / recording.T
    return np.max(np.abs(ddq) / model.arm.acceleration_limit, axis=1)


def limits_text(results: Results) -> str:
    """What docs/limits.md says of the rectangle within limits."""
    model = RobotModel.named(load_task('rectangle').robot)
    velocity = Case('minimum_velocity')
    fraction = usage_of(results[velocity].recording, model).max()
    without, within, velocity_half, acceleration_half = (
        results[case].recording
        for case in (velocity, replace(velocity, limits=LIMITS), *HALF_LIMITS)
    )
    nominal = load_task('rectangle').segments * 3.0
    velocity_lost = velocity_half['t'][-1] + T - nominal
    acceleration_lost = acceleration_half['t'][-1] + T - nominal
    return (
        f'Near the stretched arm the law of least velocity asks for {fraction:.1f} times the\n'
        "acceleration that a joint has: the paper's robot was stopped there. Within limits the\n"
        'same law finishes. The tip keeps its path and slows down to a fraction of its speed, at\n'
        f'least {within["task_scaling"].min():.2f}, so the task takes '
        f'{within["t"][-1] + T:.2f} s instead of {without["t"][-1] + T:.2f} s.\n'
        'With half the velocities and accelerations allowed, least velocity takes\n'
        f'{velocity_lost:.2f} s longer and least acceleration {acceleration_lost:.2f} s.\n'
    )


def _end(result: Result) -> str:
    return f'{result.recording["t"][-1]:.2f}' if result.effort.finished else 'none'


def _figure(value: float, least: float) -> str:
    text = f'{value:.0f}' if value >= 100.0 else f'{value:.3g}'
    return f'**{text}**' if value == least else text


def markdown(heads: str, rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown, with ' | ' between the heads."""
    rule = '|'.join('---' for _ in heads.split(' | '))
    lines = [f'| {heads} |', f'|{rule}|', *(f'| {" | ".join(row)} |' for row in rows)]
    return '\n'.join(lines) + '\n'


# --- pictures -------------------------------------------------------------------------------------


def draw_laws(results: Results) -> Figure:
    """Three laws on the rectangle, and one of them within limits."""
    figure, (accelerations, speeds, scaling) = time_panels(
        3,
        "One task, three laws: the paper's rectangle, past the stretched arm",
        (9.0, 7.5),
        (1.6, 1.0, 0.7),
    )
    model = RobotModel.named('lwr4_paper')
    unlimited = Case('minimum_velocity')
    within = replace(unlimited, limits=LIMITS)
    damping = f', $k_d$ = {DAMPING:g} s$^{{-1}}$'
    labels = {
        unlimited: 'minimum_velocity',
        within: 'minimum_velocity within limits',
        Case('minimum_acceleration'): f'minimum_acceleration{damping}',
        Case('minimum_weighted_torque'): f'minimum_weighted_torque{damping}',
    }
    for case, label in labels.items():
        recording = results[case].recording
        t = recording['t']
        style = {'color': law_colour(case.law), 'ls': '--' if case.limits else '-'}
        accelerations.plot(t, usage_of(recording, model), label=label, **style)
        speeds.plot(t, recording['joint_velocity_norm'], **style)
        if case.limits:
            scaling.plot(t, recording['task_scaling'], **style)
    _write_peak(accelerations, results[unlimited].recording, model)
    accelerations.axhline(1.0, color='black', ls=':', lw=1.3, label='limit of the joint')
    accelerations.set(yscale='log', ylim=(3e-3, 8.0))
    accelerations.set_ylabel('largest joint acceleration\n[fraction of its limit]')
    speeds.set_ylabel(r'$\Vert\dot q\Vert$ [rad/s]')
    scaling.set_ylabel('task scaling $s$')
    scaling.set_ylim(0.0, 1.1)
    legend_below(scaling, accelerations)
    return figure


def _write_peak(ax: Axes, recording: Recording, model: RobotModel) -> None:
    """How many times the limit the highest acceleration is, beside the peak."""
    fractions = usage_of(recording, model)
    tick = int(fractions.argmax())
    at = (recording['t'][tick], fractions[tick])
    style = {'textcoords': 'offset points', 'va': 'center', 'ha': 'right', 'fontsize': 'x-large'}
    ax.annotate(f'{fractions[tick]:.1f} ×', at, xytext=(-8.0, 0.0), weight='bold', **style)


def draw_rectangle_dampings(results: Results) -> Figure:
    """The norm of the acceleration with five dampings."""
    figure, (ax,) = time_panels(1, 'minimum_acceleration on the rectangle', (9.0, 4.5))
    colour = np.array(to_rgb(law_colour('minimum_acceleration')))
    for damping, shade in _DRAWN_DAMPINGS.items():
        recording = results[Case('minimum_acceleration', damping=damping)].recording
        label = f'$k_d$ = {damping:g} s$^{{-1}}$'
        ax.plot(
            recording['t'],
            recording['joint_acceleration_norm'],
            color=_shaded(colour, shade),
            label=label,
        )
    ax.set(yscale='log', xlim=(-0.1, 9.3), ylim=(1e-2, 1e3))
    ax.set_ylabel(r'$\Vert\ddot q\Vert$ [rad/s$^2$]')
    legend_below(ax, ax)
    return figure


def _shaded(colour: np.ndarray, shade: float) -> np.ndarray:
    """A shade of a colour (3,): -1 is white, 0 the colour itself, 1 black."""
    return np.array([np.interp(shade, (-1.0, 0.0, 1.0), (1.0, part, 0.0)) for part in colour])


# --- pages ----------------------------------------------------------------------------------------


def replaced(page: str, name: str, text: str) -> str:
    """A page with the block of that name replaced, if it has one."""
    pattern = re.compile(_BLOCK.format(name), re.DOTALL)
    return pattern.sub(lambda found: found[1] + text + found[3], page)


def block(page: str, name: str) -> str:
    """What stands in the block of that name."""
    found = re.search(_BLOCK.format(name), page, flags=re.DOTALL)
    if found is None:
        raise KeyError(name)
    return found[2]


def write(blocks: dict[str, str], pages: Sequence[Path] = PAGES) -> None:
    """Write blocks into whichever pages have them."""
    for path in pages:
        page = path.read_text(encoding='utf-8')
        for name, text in blocks.items():
            page = replaced(page, name, text)
        path.write_text(page, encoding='utf-8')


def all_results() -> Results:
    """Every case, on all processors."""
    bounded = Case('minimum_velocity', limits=LIMITS)
    cases = list(dict.fromkeys([*EFFORTS, bounded, *DAMPED, *BOUNDED, *HALF_LIMITS]))
    with progress_bar(f'{len(cases)} runs') as progress:
        found = in_parallel(result, cases, progress)
    return dict(zip(cases, found, strict=True))


def main() -> None:
    """Run, write the blocks, and draw."""
    results = all_results()
    write(
        {
            'efforts': effort_table(results),
            'dampings': damping_table(results),
            'headline': headline(results),
            'limits': limits_text(results),
        }
    )
    draw_laws(results).savefig(PICTURES / 'laws.png', dpi=110)
    draw_rectangle_dampings(results).savefig(PICTURES / 'damping.png', dpi=110)


if __name__ == '__main__':
    main()
