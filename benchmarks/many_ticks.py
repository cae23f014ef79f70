"""What the limits promise, held by numbers over many ticks.

    python benchmarks/many_ticks.py [--count N] [--seed S]

Controllers of every arm and law go where random and hostile task velocities send them: from inside
their limits, from their ends and from outside. The box of the single joints is computed here once
more, from its definition in docs/limits.md. Exit status 1 tells of any failure.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from redres_ros import LAWS, Controller, RobotModel, make_law
from redres_ros.errors import DivergedError
from redres_ros.robots import ARMS

OUTSIDE = 1e-12  # [rad/s] of the box, from where on it counts; q / T has an error of 4e-13
MOTION = 200  # ticks
PERIODS = (0.001, 0.002, 0.005)  # [s]
BOXES = ('position', 'velocity', 'acceleration')


@dataclass(frozen=True)
class Ends:
    """The limits of the joints, each (n,); infinite where there is none."""

    q_min: np.ndarray
    q_max: np.ndarray
    V: np.ndarray
    A: np.ndarray

    @classmethod
    def of(cls, model: RobotModel, names: tuple[str, ...], scale: float) -> 'Ends':
        """Those of an arm under limits of these names."""
        none = np.full(model.n, np.inf)
        margin = np.radians(0.5)
        A = scale * np.array(model.arm.acceleration_limit)
        has_ends = 'position' in names
        return cls(
            model.q_min + margin if has_ends else -none,
            model.q_max - margin if has_ends else none,
            scale * model.dq_max if 'velocity' in names else none,
            A,
        )

    def box(self, q: np.ndarray, dq_prev: np.ndarray, T: float, brakes: bool) -> np.ndarray:
        """The velocities that the definition allows, (2, n) [rad/s]."""
        reach = self.A * T if brakes else np.full(len(q), np.inf)
        box = np.array((dq_prev - reach, dq_prev + reach))
        velocity = np.array((-self.V, self.V))
        position = np.array(
            (-stopping_speed(q - self.q_min, self.A, T), stopping_speed(self.q_max - q, self.A, T))
        )
        for further in (velocity, position):
            box = np.clip(further, box[0], box[1])
        return box


def stopping_speed(d: np.ndarray, A: np.ndarray, T: float) -> np.ndarray:
    """beta(d), (n,) [rad/s], at d [rad] from the end; outside, a joint comes back as fast."""
    way = np.minimum(np.abs(d), 1e9)
    N = np.floor((np.sqrt(1.0 + 8.0 * way / (A * T**2)) - 1.0) / 2.0)
    return np.sign(d) * (way / T + A * T * N * (N + 1.0) / 2.0) / (N + 1.0)


class Motion:
    """A controller of some arm, law and limits, and where it begins."""

    def __init__(self, models: list[RobotModel], random: np.random.Generator) -> None:
        self.random = random
        model = models[random.integers(len(models))]
        self.names = tuple(name for name in BOXES if random.random() < 0.8) or BOXES
        self.scale = float(random.choice((1.0, 1.0, 0.5, 0.05)))
        self.T = float(random.choice(PERIODS))
        self.ends = Ends.of(model, self.names, self.scale)
        rows = ('torque', 'collision') if model.n == 7 else ('collision',)
        further = tuple(name for name in rows if random.random() < 0.15)
        self.controller = Controller(
            model,
            make_law(list(LAWS)[random.integers(len(LAWS))]),
            self.T,
            limits=self.names + further,
            limit_scale=self.scale,
            secondary_tasks=('orientation',) if random.random() < 0.1 else (),
        )
        self.q = self.start(model)

    def start(self, model: RobotModel) -> np.ndarray:
        """Within the range, at its ends, or outside, joint by joint, (n,) [rad]."""
        random = self.random
        lower = np.maximum(model.q_min, -np.pi)
        upper = np.minimum(model.q_max, np.pi)
        q = random.uniform(lower, upper)
        kind = random.random(model.n)
        q = np.where(kind < 0.1, upper - np.radians(0.5), q)
        q = np.where((kind > 0.1) & (kind < 0.15), lower, q)
        return np.where(kind > 0.97, upper + random.uniform(0.0, 0.2, model.n), q)

    def asked(self) -> Iterator[np.ndarray]:
        """Task velocities, (3,) [m/s]: steps, noise, ramps and standstill, small and huge."""
        random = self.random
        dx = np.zeros(3)
        slope = np.zeros(3)
        for k in range(MOTION):
            if k == 0 or random.random() < 0.04:
                size = 10.0 ** random.uniform(-3.0, 1.5)
                dx = random.normal(size=3) * size * random.integers(0, 4, 3).clip(0, 1)
                slope = random.normal(size=3) * size * self.T * random.integers(2)
            if random.random() < 0.02:
                dx = -dx
            dx = dx + slope
            yield dx

    def ticks(self) -> Iterator[str]:
        """What came of each tick; empty where all is well."""
        controller = self.controller
        q_ref = self.q
        dq_prev = np.zeros(len(q_ref))
        lag = np.zeros(len(q_ref))  # of the arm behind its reference, which begins where it is
        for dx in self.asked():
            box = self.ends.box(q_ref, dq_prev, self.T, 'acceleration' in self.names)
            try:
                command = controller.update(q_ref - lag, dx)
            except DivergedError:
                yield '' if 'velocity' not in self.names else 'no command'
                return
            excess = max((command.dq - box[1]).max(), (box[0] - command.dq).max())
            yield fault(command.dq, excess)
            q_ref = command.q_ref
            dq_prev = command.dq
            lag = 0.01 * self.random.normal(size=len(q_ref)) * self.random.integers(2)


def fault(dq: np.ndarray, excess: float) -> str:
    """What is wrong with a command (n,) [rad/s] that leaves its box by so much [rad/s]."""
    if not np.isfinite(dq).all():
        return 'not finite'
    return 'outside the box' if excess > OUTSIDE else ''


def try_ticks(count: int, seed: int) -> Counter[str]:
    """Faults of so many ticks; '' counts those without."""
    random = np.random.default_rng(seed)
    models = [RobotModel.named(name) for name in ARMS]
    found: Counter[str] = Counter()
    while found.total() < count:
        found.update(Motion(models, random).ticks())
    return found


def main(arguments: list[str] | None = None) -> int:
    """Print what came of it; 0 where nothing failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--count', type=int, default=10_000)
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args(arguments)
    found = try_ticks(options.count, options.seed)
    good = found.pop('', 0)
    faults = ', '.join(f'{count} {name}' for name, count in found.items()) or 'none'
    print(f'{good + found.total()} ticks from seed {options.seed}; faults: {faults}')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
