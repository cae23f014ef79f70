"""Films docs/demo.webp: two laws on the paper's task, one stopped by the robot and one not.

Run it with: python docs/make_film.py
"""

from pathlib import Path

from film import FilmedMotion, write_film

from redres_ros.paper.runs import MOTIONS, Runs


def main() -> None:
    """Run the two experiments and film them."""
    runs = Runs()
    motions = []
    for name in ('measured_2', 'measured_23'):
        law = MOTIONS[name].law
        motions.append(FilmedMotion(runs[name].recording, law, law))
    write_film(motions, runs.experiment_model, runs.task, Path(__file__).with_name('demo.webp'))


if __name__ == '__main__':
    main()
