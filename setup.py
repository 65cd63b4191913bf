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
from pathlib import Path
import sys

sys.path.insert(0, str(Path(__file__).parent.absolute()))  # pip leaves that to us

from rt_robot_os.base.compiled.build import BuildCore  # noqa: E402
from rt_robot_os.base.compiled.build import extensions  # noqa: E402
from rt_robot_os.base.compiled.build import wheel_options  # noqa: E402
from rt_robot_os.base.features import programs  # noqa: E402
from rt_robot_os.base.requirements import extras_require  # noqa: E402
from rt_robot_os.base.requirements import install_requires  # noqa: E402
from setuptools import find_packages  # noqa: E402
from setuptools import setup  # noqa: E402

package_name = 'rt_robot_os'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(include=[package_name, package_name + '.*']),
    package_data={package_name: ['py.typed', 'devices/*/page.md', 'features/*/*/page.md',
                                 '*/_*.[ch]',
                                 'monitor/page/*.*', 'monitor/page/*/*.*', 'monitor/page/*/*/*.*',
                                 'tools/plan/typical.json', 'tools/new/templates/*.in']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', sorted(glob('config/*.*'))),
        ('share/' + package_name + '/config/maps', sorted(glob('config/maps/*.*'))),
        ('share/' + package_name + '/config/scenarios', sorted(glob('config/scenarios/*.*'))),
        ('share/' + package_name + '/launch', sorted(glob('launch/*.xml'))),
    ],
    ext_modules=extensions(),
    options=wheel_options(),
    cmdclass={'build_ext': BuildCore},
    install_requires=install_requires(),
    extras_require=extras_require(),
    python_requires='>=3.10',
    zip_safe=False,
    author='The rt_robot_os authors',
    maintainer='The rt_robot_os authors',
    maintainer_email='maintainers@rt-robot-os.example.org',
    description='A preemptive fixed-priority real-time kernel for Python robot code.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            *(f'{name} = {module}:main' for name, module in programs().items()),
            'bench = rt_robot_os.tools.bench.program:main',
            'black_box = rt_robot_os.tools.black_box.program:main',
            'core = rt_robot_os.core.program:main',
            'doctor = rt_robot_os.tools.doctor.program:main',
            'echo = rt_robot_os.ros.echo_program:main',
            'gateway = rt_robot_os.gateway.program:main',
            'i2c_bridge = rt_robot_os.devices.i2c.program:main',
            'monitor = rt_robot_os.monitor.program:main',
            'new = rt_robot_os.tools.new.program:main',
            'parameters = rt_robot_os.tools.parameters.program:main',
            'plan = rt_robot_os.tools.plan.program:main',
            'player = rt_robot_os.sim.player_program:main',
            'record = rt_robot_os.recording.record_program:main',
            'rehearse = rt_robot_os.tools.rehearse.program:main',
            'replay = rt_robot_os.recording.replay_program:main',
            'robot = rt_robot_os.ros.program:main',
            'simulator = rt_robot_os.core.simulator_program:main',
            'top = rt_robot_os.tools.top.program:main',
        ],
    },
)
