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

"""The content of the package for colcon and setuptools, and its plug-ins for rt_robot_os."""

from glob import glob

from setuptools import find_packages
from setuptools import setup

package_name = 'rt_robot_example'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', glob('config/*.yaml')),
        ('share/' + package_name + '/launch', glob('launch/*.xml')),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['hypothesis', 'pytest']},
    zip_safe=True,
    maintainer='Your Name',
    maintainer_email='you@example.org',
    description='A package with a driver and a module for rt_robot_os.',
    license='Apache-2.0',
    entry_points={
        'rt_robot_os.devices': [
            'battery_gauge = rt_robot_example.battery_gauge'],
        'rt_robot_os.modules': [
            'low_battery = rt_robot_example.low_battery:LowBattery'],
        'rt_robot_os.payloads': [
            'soil = rt_robot_example.garden:SOIL'],
    },
)
