"""Writes the figures of README.md and docs/choosing_a_law.md anew, and draws that page's pictures.

Run it with: python docs/make_numbers.py
The tables over random tasks take minutes, and come from: python docs/make_numbers.py --sweep
"""

import argparse
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from matplotlib.figure import Figure

from redres_ros import LAWS, Controller, Effort, Recording, RobotModel, load_task, make_law, run
from redres_ros.paper.figures.architecture import figure_1
from redres_ros.simulation.dampings import GOOD, Trials, draw_dampings, sweep
from redres_ros.simulation.parallel import in_parallel
from redres_ros.simulation.report import progress_bar
from redres_ros.simulation.shares import acceleration_share

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / 'README.md', ROOT / 'docs' / 'choosing_a_law.md')
PICTURES = ROOT / 'docs'

T = 0.002  # sampling time [s], that of the nodes
DAMPING = 10.0  # k_d [1/s]
DAMPINGS = (0.0, 2.0, 5.0, 8.0, 10.0, 12.0, 15.0, 20.0, 50.0, 1.0 / T)
LIMITS = ('position', 'velocity', 'acceleration')
TASKS = ('rectangle', 'rectangle_reversed', 'window', 'table')
SWEPT = ('minimum_acceleration',)
RANDOM_TASKS = 300
SWEEP_T = 0.01  # [s]

_QUANTILES = {
    0.5: 'median of peak / best',
    0.9: 'nine in ten below',
    0.99: '99 in 100 below',
}
_BLOCK = r'(<!-- numbers: {} -->\n)(.*?)(<!-- end -->)'
_EFFORT = ('acceleration', 'velocity', 'torque', 'squared_torque', 'kinetic_energy', 'elbow')


@dataclass(frozen=True)
class Case:
    """One run of which the pages tell."""

    law: str
    task: str = 'rectangle'
    damping: float = DAMPING
    limits: tuple[str, ...] = ()


@dataclass(frozen=True)
class Result:
    """What came of it."""

    recording: Recording
    effort: Effort


Results = dict[Case, Result]


def efforts() -> list[Case]:
    """Cases of the table of efforts."""
    return [Case(law) for law in LAWS]


def within() -> list[Case]:
    """Cases of the table of laws and tasks, without and with limits."""
    return [Case(law, task, limits=on) for law in LAWS for task in TASKS for on in ((), LIMITS)]


def dampings() -> list[Case]:
    """Cases of the table of dampings, without limits."""
    return [Case('minimum_acceleration', damping=damping) for damping in DAMPINGS]


def bounded_dampings() -> list[Case]:
    """The same with limits."""
    return [replace(case, limits=LIMITS) for case in dampings()]


def result(case: Case, _: Callable[[float], None] = lambda share: None) -> Result:
    """Run it."""
    task = load_task(case.task)
    model = RobotModel.named(task.robot)
    law = make_law(case.law, damping=case.damping)
    recording = run(Controller(model, law, T, limits=case.limits), task)
    return Result(recording, Effort.of(recording, model))


# --- tables ---------------------------------------------------------------------------------------


def effort_table(results: Results) -> str:
    """One row a law, on the rectangle, without limits."""
    heads = 'law | k_d [1/s] | max ‖q̈‖ [rad/s²] | max ‖q̇‖ [rad/s] | max ‖τ‖ [Nm] | '
    heads += "∫‖τ‖² [Nm² s] | ∫ energy [J s] | elbow's path [m]"
    least = {
        name: min(getattr(results[case].effort, name) for case in efforts()) for name in _EFFORT
    }
    rows = []
    for case in efforts():
        effort = results[case].effort
        damping = f'{case.damping:g}' if LAWS[case.law].has_memory else '–'
        figures = [_figure(getattr(effort, name), least[name]) for name in _EFFORT]
        rows.append([f'`{case.law}`', damping, *figures])
    return _table(heads, rows)


def limits_table(results: Results) -> str:
    """Laws and tasks: the first joint beyond a limit without limits, the end with them."""
    rows = []
    for law in LAWS:
        cells = [_answer(results, law, task) for task in TASKS]
        rows.append([f'`{law}`', *cells])
    return _table('law | ' + ' | '.join(f'`{task}`' for task in TASKS), rows)


def damping_table(results: Results) -> str:
    """The largest acceleration of least acceleration on the rectangle, by damping."""
    heads = 'k_d [1/s] | ' + ' | '.join(f'{case.damping:g}' for case in dampings())
    peaks = [f'{results[case].effort.acceleration:.1f}' for case in dampings()]
    kept = ['yes' if not results[case].effort.violation else 'no' for case in dampings()]
    ends = [_end(results[case]) for case in bounded_dampings()]
    rows = [
        ['max ‖q̈‖ [rad/s²]', *peaks],
        ['within the limits?', *kept],
        ['end with limits on [s]', *ends],
    ]
    return _table(heads, rows)


def headline(results: Results) -> str:
    """What README says of the laws on the rectangle."""
    shares = {}
    for law in ('minimum_velocity', 'minimum_acceleration'):
        model = RobotModel.named(load_task('rectangle').robot)
        share = acceleration_share(results[Case(law)].recording, model)
        shares[law] = float(share.max())
    bounded = results[Case('minimum_velocity', limits=LIMITS)].recording
    velocity = shares['minimum_velocity']
    acceleration = shares['minimum_acceleration']
    return (
        f'Near the stretched arm `minimum_velocity` asks a joint for {velocity:.1f} times the\n'
        f'acceleration that it has, `minimum_acceleration` for {acceleration:.0%} of it. Within\n'
        f'limits `minimum_velocity` finishes too, in {bounded["t"][-1]:.2f} s instead of 9.00 s.\n'
    )


def sweep_table(results: Sequence[Trials]) -> str:
    """Random tasks: how often a damping is good, and how bad it is else."""
    heads = 'law | k_d [1/s] | ' + ' | '.join(f'{damping:g}' for damping in results[0].dampings)
    rows = []
    for trials in results:
        good = [f'{share:.0%}' for share in trials.good]
        rows.append([f'`{trials.law}`', f'within {GOOD:g} × the best', *good])
        for share, name in _QUANTILES.items():
            rows.append(['', name, *(f'{ratio:.3g}' for ratio in trials.quantiles(share))])
        kept = [f'{share:.0%}' for share in trials.kept.mean(axis=0)]
        rows.append(['', "within the joints' limits", *kept])
    return _table(heads, rows)


def _answer(results: Results, law: str, task: str) -> str:
    without = results[Case(law, task)].effort
    bounded = results[Case(law, task, limits=LIMITS)]
    free = f'no: {_short(without.violation)}' if without.violation else 'yes'
    scaling = float(bounded.recording['task_scaling'].min())
    slowed = '' if scaling > 0.9995 else f', s ≥ {scaling:.2f}'
    end = f'{bounded.recording["t"][-1]:.2f} s{slowed}' if bounded.effort.finished else 'not ended'
    return f'{free}; {end}'


def _end(result: Result) -> str:
    return f'{result.recording["t"][-1]:.2f}' if result.effort.finished else 'none'


def _short(violation: str) -> str:
    """'lwr_a2_joint position, 2.48 s' -> 'A2 position, 2.48 s'."""
    return re.sub(r'lwr_(\w\d)_joint', lambda found: found[1].upper(), violation)


def _figure(value: float, least: float) -> str:
    text = f'{value:.0f}' if value >= 100.0 else f'{value:.3g}'
    return f'**{text}**' if value == least else text


def _table(heads: str, rows: Sequence[Sequence[str]]) -> str:
    rule = '|'.join('---' for _ in heads.split(' | '))
    lines = [f'| {heads} |', f'|{rule}|', *(f'| {" | ".join(row)} |' for row in rows)]
    return '\n'.join(lines) + '\n'


# --- pictures -------------------------------------------------------------------------------------


def draw_laws(results: Results) -> Figure:
    """Three laws on the rectangle: shares of the acceleration limits, and velocities."""
    figure = Figure(figsize=(9.0, 6.0), layout='constrained')
    shares, speeds = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1.0))
    model = RobotModel.named('lwr4_paper')
    curves = {
        'minimum_velocity': Case('minimum_velocity'),
        'the same within limits': Case('minimum_velocity', limits=LIMITS),
        f'minimum_acceleration, $k_d$ = {DAMPING:g} s$^{{-1}}$': Case('minimum_acceleration'),
        f'minimum_weighted_torque, $k_d$ = {DAMPING:g} s$^{{-1}}$': Case('minimum_weighted_torque'),
    }
    for label, case in curves.items():
        recording = results[case].recording
        shares.plot(recording['t'], acceleration_share(recording, model), lw=1.3, label=label)
        speeds.plot(recording['t'], recording['joint_velocity_norm'], lw=1.3)
    shares.axhline(1.0, color='black', ls=':', lw=1.3, label='limit of the joint')
    shares.set(yscale='log', ylim=(3e-3, 6.0))
    shares.set_ylabel('largest joint acceleration\n[share of its limit]')
    shares.set_title("One task, three laws: the paper's rectangle, past the stretched arm")
    speeds.set_ylabel(r'$\Vert\dot q\Vert$ [rad/s]')
    speeds.set_xlabel('time [s]')
    return _finished(figure, shares, speeds)


def draw_rectangle_dampings(results: Results) -> Figure:
    """The norm of the acceleration with five dampings."""
    figure = Figure(figsize=(9.0, 4.5), layout='constrained')
    ax = figure.add_subplot()
    for case in dampings():
        if case.damping in (0.0, 2.0, 10.0, 20.0, 50.0):
            recording = results[case].recording
            label = f'$k_d$ = {case.damping:g} s$^{{-1}}$'
            ax.plot(recording['t'], recording['joint_acceleration_norm'], lw=1.3, label=label)
    ax.set(yscale='log', xlim=(-0.1, 9.3), ylim=(1e-2, 1e3), xlabel='time [s]')
    ax.set_ylabel(r'$\Vert\ddot q\Vert$ [rad/s$^2$]')
    ax.set_title('minimum_acceleration on the rectangle')
    return _finished(figure, ax)


def _finished(figure: Figure, *axes: object) -> Figure:
    for ax in axes:
        ax.grid(alpha=0.3)
        ax.set_xmargin(0.01)
    lines = axes[0].get_legend_handles_labels()
    figure.legend(*lines, loc='outside lower center', ncols=2)
    return figure


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


def write(blocks: dict[str, str]) -> None:
    """Write blocks into whichever pages have them."""
    for path in PAGES:
        page = path.read_text(encoding='utf-8')
        for name, text in blocks.items():
            page = replaced(page, name, text)
        path.write_text(page, encoding='utf-8')


def all_results() -> Results:
    """Every case, on all processors."""
    cases = list(dict.fromkeys([*efforts(), *within(), *dampings(), *bounded_dampings()]))
    with progress_bar(f'{len(cases)} runs') as progress:
        found = in_parallel(result, cases, progress)
    return dict(zip(cases, found, strict=True))


def main() -> None:
    """Run what is wanted, write the blocks, and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--sweep', action='store_true', help='only the tables over random tasks')
    if parser.parse_args().sweep:
        model = RobotModel.named('lwr4_paper')
        with progress_bar(f'{RANDOM_TASKS} random tasks') as progress:
            swept = sweep(model, 'lwr4_paper', SWEPT, RANDOM_TASKS, SWEEP_T, progress)
        write({'sweep': sweep_table(swept)})
        title = f"{RANDOM_TASKS} random tasks of the paper's arm"
        draw_dampings(swept, title).savefig(PICTURES / 'random_dampings.png', dpi=110)
        return
    results = all_results()
    write(
        {
            'efforts': effort_table(results),
            'within': limits_table(results),
            'dampings': damping_table(results),
            'headline': headline(results),
        }
    )
    figure = figure_1()
    figure.axes[0].set_title('')  # it is no number of a page
    figure.savefig(PICTURES / 'architecture.png', dpi=90)
    draw_laws(results).savefig(PICTURES / 'laws.png', dpi=110)
    draw_rectangle_dampings(results).savefig(PICTURES / 'damping.png', dpi=110)


if __name__ == '__main__':
    main()
