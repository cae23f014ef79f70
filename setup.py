"""One package for two installers: colcon, beside a ROS installation, and pip, which brings ROS from
PyPI along.
"""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

NAME = 'redres_ros'

# Version, description, licence and maintainer stand in package.xml alone.
PACKAGE = ElementTree.parse(Path(__file__).parent / 'package.xml').getroot()
MAINTAINER = PACKAGE.find('maintainer')

# The library asks for little, so that it fits beside a robot's driver. The fake robot has an extra
# of its own: a distribution has no package of MuJoCo.
FAKE = ['mujoco>=3.10']  # whose mj_fullM takes the data
# What `redres` needs beyond the library: the fake robot, plots, a page, and the paper's filters.
TOOLS = [*FAKE, 'matplotlib>=3.6', 'viser>=1.1', 'scipy>=1.11']
# What the nodes need beside a robot, and then beside the fake one.
ROBOT = [
    # ros-rclpy alone would bring a newer ROS than Jazzy
    'ros-jazzy-rclpy[fastrtps]',
    'ros-jazzy-common-interfaces',
]
ROS = [*TOOLS, *ROBOT]
# The site asks the nodes what they have.
DOCS = [
    *ROS,
    'sphinx>=8.2',
    'myst-parser>=4.0.1',
    'furo>=2025.7.19',
    'sphinx-copybutton>=0.5.2',
    'latex2mathml>=3.77',
]


def shared(folder: str, pattern: str) -> list[tuple[str, list[str]]]:
    """The data_files rows that put the folder's matching files under share/redres_ros, in the same
    subfolders.
    """
    files = sorted(path for path in Path(folder).rglob(pattern) if path.is_file())
    return [(f'share/{NAME}/{path.parent.as_posix()}', [path.as_posix()]) for path in files]


setup(
    name=NAME,
    version=PACKAGE.findtext('version'),
    description=PACKAGE.findtext('description'),
    license=PACKAGE.findtext('license'),
    author=PACKAGE.findtext('author'),
    url=PACKAGE.findtext('url'),
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get('email'),
    keywords=['ROS', 'robotics', 'redundancy resolution', 'inverse kinematics'],
    classifiers=[
        'Intended Audience :: Science/Research',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Topic :: Scientific/Engineering',
        'Typing :: Typed',
    ],
    python_requires='>=3.11',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={NAME: ['py.typed', 'nodes/*.xml', 'files/*.yaml', 'robots/*.urdf', 'view/*.js']},
    zip_safe=False,
    # The oldest versions are those of Ubuntu 24.04, with Pinocchio of Jazzy. pip itself takes newer
    # ones: what PyPI has of Pinocchio 3 asks for numpy 2.
    install_requires=[
        'numpy>=1.26',
        'numba>=0.59',
        'pin>=3.3.1',
        'PyYAML>=6.0.1',
        'rich>=13.0',
    ],
    extras_require={
        'fake': FAKE,
        'tools': TOOLS,
        'robot': ROBOT,
        'ros': ROS,
        'docs': DOCS,
        'bench': [  # others' inverse kinematics, which benchmarks/ sets beside ours
            'embodik>=0.23',
            'roboplan-oink>=0.7',
            'pin-pink>=4.4',
            'mink>=1.3',
            'qpsolvers>=4.13',
            'quadprog>=0.1.14',
        ],
        'test': [
            *DOCS,
            'playwright>=1.45',  # steers a Chromium that is there
            'pytest>=7.4',
            'pytest-cov>=6.0',
            'pytest-xdist>=3.5',
            'hypothesis>=6.90',
            'cyclonedds>=0.10.5',  # another vendor's DDS, which takes part in a test
            # Their verdict changes from version to version.
            'ruff==0.17.6',
            'mypy==2.4.1',
            'scipy-stubs',
            'types-PyYAML',
            'colcon-ros',
            'colcon-bash',
            # from 70.1 on it builds wheels by itself; colcon needs one below 80
            'setuptools>=70.1,<80',
        ],
    },
    entry_points={
        'console_scripts': [
            'redres = redres_ros.cli:main',
            # These land in bin/, which all packages of an environment share: hence the long names.
            'redres_composed = redres_ros.nodes.entry:composed',
            'redres_controller = redres_ros.nodes.entry:controller',
            'redres_planner = redres_ros.nodes.entry:planner',
            'redres_sim = redres_ros.nodes.entry:sim',
        ],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        *shared('config', '*'),
        *shared('launch', '*.launch.py'),
        # The names that `ros2 run` looks for, where it looks. They start the scripts in bin/, so
        # that both installers lay out the same files, and a setup.cfg that sends the scripts
        # themselves to lib/ is not needed.
        (
            f'lib/{NAME}',
            ['scripts/composed', 'scripts/controller', 'scripts/planner', 'scripts/sim'],
        ),
    ],
)
