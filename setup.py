# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Installs the package by pip, and by colcon as an ament_python package."""

from glob import glob
import sys

from setuptools import find_packages, setup

package_name = 'collision_sim'


def shared(folder):
    """Where ROS looks for the files of one folder of the package, and those files."""
    return f'share/{package_name}/{folder}', sorted(glob(f'{package_name}/{folder}/*.*'))


def pages():
    """Where the pages of the documentation go, folder by folder, and those pages."""
    return [shared(folder) for folder in ('docs', *(
        f'docs/{each}' for each in ('explanation', 'how_to', 'pictures', 'reference',
                                    'tutorials')))]


def executables():
    """Where `ros2 run` looks, for pip; colcon puts the scripts of the entry points there."""
    if not {'bdist_wheel', 'editable_wheel'} & set(sys.argv):
        return []
    return [(f'lib/{package_name}', sorted(glob('resource/lib/*')))]


setup(
    name=package_name,
    version='0.1.0',
    description='Particles that collide with fixed and moving colliders; '
                'a Python library and a ROS 2 node.',
    maintainer='collision_sim developers',
    maintainer_email='nobody@collision-sim.invalid',    # package.xml says why
    license='Apache-2.0',
    python_requires='>=3.11',
    packages=find_packages(include=[package_name, f'{package_name}.*']),
    package_data={package_name: ['config/*.*', 'docs/*.*', 'docs/*/*.*', 'launch/*.*',
                                 'mkdocs.yml', 'rviz/*.*', 'scenes/*.*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
        shared('config'),
        shared('launch'),
        shared('scenes'),
        shared('rviz'),
        *pages(),
        *executables(),
    ],
    zip_safe=False,
    # The oldest Numba that knows NumPy 1.26, and the oldest for Python 3.12: see .ci/run.
    install_requires=['numba>=0.58.1; python_version < "3.12"',
                      'numba>=0.59; python_version >= "3.12"', 'numpy>=1.26', 'PyYAML', 'tqdm'],
    extras_require={
        # The figures of `collision_sim report`.
        'report': ['matplotlib'],
        # Meshes in glTF and 3MF files.
        'meshes': ['lxml', 'networkx', 'trimesh'],
        # The pages of collision_sim/docs as a web site.
        'docs': ['mkdocs>=1.6,<2', 'mkdocstrings[python]>=0.26'],
        # `collision_sim run` with --record and --poses.
        'record': ['rosbags>=0.11'],
        # `collision_sim sweep` on a Dask cluster, and its tables in Parquet.
        'sweep': ['distributed', 'pyarrow'],
        # `springs` with `solver: implicit`.
        'springs': ['scipy'],
        # `collision_sim view`, and `viewer` of the node: a page with WebGL in one wheel.
        'viewer': ['viser>=1.0,<2'],
        # rclpy and Fast DDS as wheels, for machines without an installed ROS.
        'ros': [
            'ros-jazzy-common-interfaces',
            'ros-jazzy-rclpy',
            'ros-jazzy-rmw-fastrtps-cpp',
        ],
        # The flake8 plugins are those of ament_flake8.
        'test': [
            'catkin_pkg',
            'distributed',
            'flake8',
            'flake8-blind-except',
            'flake8-builtins',
            'flake8-class-newline',
            'flake8-comprehensions',
            'flake8-deprecated',
            'flake8-docstrings',
            'flake8-import-order',
            'flake8-quotes',
            'hypothesis',
            'lxml',
            'matplotlib',
            'networkx',
            'pyarrow',
            'pydocstyle',
            'pytest',
            'pytest-timeout',
            'pytest-xdist',
            'rosbags>=0.11',
            'scipy',
            'selenium',
            'trimesh',
            'viser>=1.0,<2',
        ],
    },
    entry_points={
        'console_scripts': [
            'collision_sim = collision_sim.cli:main',
            'collision_sim_node = collision_sim.ros.start:main',
            'swing_paddle = collision_sim.ros.swing_paddle:main',
        ],
    },
)
