# Copyright 2026 The rt_robot_os authors
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

"""Describe the package to colcon and setuptools."""

from glob import glob

from setuptools import find_packages
from setuptools import setup

package_name = 'rt_robot_os'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test', 'test.*']),
    package_data={package_name: ['py.typed', 'devices/*/page.md', 'tools/plan/typical.json',
                                 'cli/templates/*.in']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', sorted(glob('config/*.*'))),
        ('share/' + package_name + '/launch', sorted(glob('launch/*.xml'))),
    ],
    install_requires=['setuptools'],
    extras_require={'attitude': ['vqf'], 'camera': ['opencv-python-headless', 'pillow'],
                    'docs': ['sphinx>=7.2'],
                    'i2c': ['smbus2'], 'peers': ['horus-robotics'],
                    'plot': ['matplotlib'], 'record': ['mcap>=1.3'], 'sound': ['sounddevice'],
                    'top': ['rich'],
                    'attitude-comparison': ['ahrs', 'h5py', 'imufusion', 'scipy', 'vqf'],
                    'test': ['hypothesis', 'mcap>=1.3', 'mcap-ros2-support', 'pillow', 'pytest',
                             'rich', 'rosbags']},
    python_requires='>=3.10',
    zip_safe=False,
    author='The rt_robot_os authors',
    maintainer='The rt_robot_os authors',
    maintainer_email='maintainers@rt-robot-os.example.org',
    description='A preemptive fixed-priority real-time kernel for Python robot code.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'bench = rt_robot_os.cli.bench:main',
            'black_box = rt_robot_os.cli.black_box:main',
            'core = rt_robot_os.cli.core:main',
            'doctor = rt_robot_os.cli.doctor:main',
            'echo = rt_robot_os.cli.echo:main',
            'i2c_bridge = rt_robot_os.cli.i2c_bridge:main',
            'new = rt_robot_os.cli.new:main',
            'parameters = rt_robot_os.cli.parameters:main',
            'plan = rt_robot_os.cli.plan:main',
            'player = rt_robot_os.sim.program:player',
            'record = rt_robot_os.cli.record:main',
            'replay = rt_robot_os.cli.replay:main',
            'robot = rt_robot_os.cli.robot:main',
            'simulator = rt_robot_os.sim.program:main',
            'top = rt_robot_os.cli.top:main',
        ],
    },
)
