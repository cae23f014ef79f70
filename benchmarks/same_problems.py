"""The problems of test/test_constrained.py through pink, mink, embodik and OInK: what each makes of
them.

A problem is a Jacobian (3, 7), a box of joint velocities and a task velocity. Wanted is the largest
share of it that the box allows, in its direction. Linear programming tells how large that is.

    python benchmarks/same_problems.py [--count N] [--stretch X]

prints a table for docs/solver_tests.md. Needs the extras bench and test.
"""

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / 'test'))

from test_constrained import Problem, largest_share

from redres_ros.robots import find_arm

OUTSIDE = 1e-6  # [rad/s] beyond the box
ASIDE = 1e-6  # of the task velocity, across its direction
LESS = 1e-6  # of the share
STIFF = 1e3  # cost of the task, beside a damping of 1e-6

Solve = Callable[[Problem], np.ndarray]


def ours(problem: Problem) -> np.ndarray:
    return problem.bounded().dq


def pink_with(solver: str) -> Solve:
    import pink
    import pinocchio as pin
    import qpsolvers
    from pink.limits import Limit
    from pink.tasks import Task

    class Given(Task):
        problem: Problem

        def compute_error(self, configuration: Any) -> np.ndarray:
            return -self.problem.dx

        def compute_jacobian(self, configuration: Any) -> np.ndarray:
            return self.problem.J

        def __repr__(self) -> str:
            return 'Given()'

    class Box(Limit):
        problem: Problem

        def compute_qp_inequalities(
            self, configuration: Any, dt: float
        ) -> tuple[np.ndarray, np.ndarray]:
            return box_as_inequalities(self.problem)

    model = pin.buildModelFromXML(find_arm('lwr4').description())
    configuration = pink.Configuration(model, model.createData(), np.zeros(model.nq))
    task, box = Given(cost=STIFF), Box()

    def solve(problem: Problem) -> np.ndarray:
        task.problem = box.problem = problem
        built = pink.build_ik(configuration, [task], 1.0, damping=1e-6, limits=[box])
        return qpsolvers.solve_problem(built, solver).x

    return solve


def mink_with(solver: str) -> Solve:
    import mink
    import mujoco
    import qpsolvers

    class Given(mink.Task):
        problem: Problem

        def compute_error(self, configuration: Any) -> np.ndarray:
            return -self.problem.dx

        def compute_jacobian(self, configuration: Any) -> np.ndarray:
            return self.problem.J

    class Box(mink.Limit):
        problem: Problem

        def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
            return mink.Constraint(*box_as_inequalities(self.problem))

    model = mujoco.MjModel.from_xml_string(find_arm('lwr4').description())
    configuration = mink.Configuration(model)
    task, box = Given(cost=np.full(3, STIFF)), Box()

    def solve(problem: Problem) -> np.ndarray:
        task.problem = box.problem = problem
        built = mink.build_ik(configuration, [task], 1.0, damping=1e-6, limits=[box])
        return qpsolvers.solve_problem(built, solver).x

    return solve


def embodik_with(refined: bool) -> Solve:
    import embodik

    unit = np.asfortranarray(np.eye(7))

    def solve(problem: Problem) -> np.ndarray:
        return np.array(
            embodik.computeMultiObjectiveVelocitySolutionEigen(
                [problem.dx],
                [np.asfortranarray(problem.J)],
                unit,
                *problem.box,
                refine_partial_scale=refined,
            ).solution
        )

    return solve


def oink(problem: Problem) -> np.ndarray:
    """OInK takes arms, not Jacobians: here one of sliding joints, whose axes are the columns."""
    from roboplan.core import CartesianConfiguration, Scene, loadUrdfSceneDescriptionFromXml
    from roboplan.optimal_ik import FrameTask, FrameTaskOptions, Oink, OinkSettings, PositionLimit

    sizes = np.linalg.norm(problem.J, axis=0)  # (7,) of a step of each joint [m]
    scene = Scene('tip', loadUrdfSceneDescriptionFromXml(sliding_arm(problem, sizes)))
    settings = OinkSettings()
    settings.eps_abs = 1e-9
    solver = Oink(scene, settings)
    target = np.eye(4)
    target[:3, 3] = problem.dx
    options = FrameTaskOptions(orientation_cost=0.0)
    task = FrameTask(solver, scene, CartesianConfiguration('', 'tip', target), options)
    step = np.zeros(7)
    solver.solveIk(np.zeros(7), [task], [PositionLimit(solver)], [], step, 1e-12)
    return step / sizes


def sliding_arm(problem: Problem, sizes: np.ndarray) -> str:
    """The URDF of an arm at rest in its zeros, whose ranges are the box.

    Args:
        problem: With the columns and the box.
        sizes: Of the columns, (7,).
    """
    parts = ['<robot name="sliding"><link name="link_0"/>']
    lower_ends, upper_ends = (sizes * problem.box).tolist()
    rows = zip(problem.J.T / sizes[:, None], lower_ends, upper_ends, strict=True)
    for joint, (axis, lower, upper) in enumerate(rows, start=1):
        child = 'tip' if joint == 7 else f'link_{joint}'
        parts.append(
            f'<link name="{child}"/><joint name="joint_{joint}" type="prismatic">'
            f'<parent link="link_{joint - 1}"/><child link="{child}"/>'
            f'<axis xyz="{" ".join(f"{value!r}" for value in axis.tolist())}"/>'
            f'<limit lower="{lower!r}" upper="{upper!r}" velocity="99" effort="1"/></joint>'
        )
    return ''.join([*parts, '</robot>'])


def box_as_inequalities(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """G dq <= h of the box."""
    lower, upper = problem.box
    return np.vstack((np.eye(7), -np.eye(7))), np.concatenate((upper, -lower))


def solvers() -> dict[str, Solve]:
    return {
        'redres_ros': ours,
        'embodik': embodik_with(refined=False),
        'embodik, refined': embodik_with(refined=True),
        'OInK': oink,
        'pink, quadprog': pink_with('quadprog'),
        'pink, daqp': pink_with('daqp'),
        'pink, proxqp': pink_with('proxqp'),
        'mink, quadprog': mink_with('quadprog'),
        'mink, daqp': mink_with('daqp'),
        'mink, proxqp': mink_with('proxqp'),
    }


def faults(problem: Problem, dq: np.ndarray | None, share: float) -> Iterator[str]:
    """What is wrong with a command, of which the largest share is known."""
    if dq is None or not np.isfinite(dq).all():
        yield 'failed'
        return
    lower, upper = problem.box
    if max((dq - upper).max(), (lower - dq).max()) > OUTSIDE:
        yield 'outside'
    velocity = problem.J @ dq
    own = velocity @ problem.dx / (problem.dx @ problem.dx)
    if np.linalg.norm(velocity - own * problem.dx) > ASIDE * np.linalg.norm(problem.dx):
        yield 'off the path'
    elif own < share - LESS:
        yield 'less'


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--count', type=int, default=2000, help='problems')
    parser.add_argument('--stretch', type=float, default=1.0, help='factor on task velocities')
    options = parser.parse_args()
    problems = [Problem(seed, None, options.stretch) for seed in range(options.count)]
    shares = [largest_share(problem.J, problem.dx, problem.box) for problem in problems]
    print(f'{options.count} problems, task velocities times {options.stretch:g}\n')
    print('| | failed | outside the box | off the path | less than the largest share |')
    print('|---|---|---|---|---|')
    for name, solve in solvers().items():
        found = [
            count_of(solve, problem, share) for problem, share in zip(problems, shares, strict=True)
        ]
        counts = [
            sum(kind in each for each in found)
            for kind in ('failed', 'outside', 'off the path', 'less')
        ]
        print(f'| {name} | ' + ' | '.join(f'{count}' for count in counts) + ' |', flush=True)


def count_of(solve: Solve, problem: Problem, share: float) -> set[str]:
    """The faults of one command."""
    try:
        dq = solve(problem)
    except Exception:  # noqa: BLE001 (whatever a peer raises is a failure of it)
        dq = None
    return set(faults(problem, dq, share))


if __name__ == '__main__':
    main()
