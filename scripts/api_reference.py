#!/usr/bin/env python3
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

"""
Make the API reference from the docstrings, as HTML, with Sphinx.

    .venv/bin/pip install sphinx
    .venv/bin/python scripts/api_reference.py [--out build/api]

Any warning is an error: a docstring that Sphinx does not understand is to be mended.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import os
from pathlib import Path
import subprocess
import sys
import tempfile

ROOT = Path(__file__).resolve().parents[1]
SWITCH = 'RT_ROBOT_OS_COMPILE'

# What users write code against: page -> title, modules.
PAGES = {
    'modules': ('Modules', ['rt_robot_os.modules', 'rt_robot_os.topics.ports',
                            'rt_robot_os.base.schema', 'rt_robot_os.base.logger']),
    'devices': ('Devices', [f'rt_robot_os.devices.{name}' for name in (
        'device', 'serial.device', 'framing', 'serial.handshake', 'imu', 'ranging', 'signatures',
        'i2c.device', 'capture.device')]),
    'sim': ('Simulated devices',
            ['rt_robot_os.sim.device', 'rt_robot_os.devices.i2c.simulated_device']),
    'testing': ('Testing', ['rt_robot_os.testing']),
    'topics': ('Topics', ['rt_robot_os.topics']),
    'kernel': ('Kernel', ['rt_robot_os.kernel']),
    'link': ('Clients of the core', ['rt_robot_os.link', 'rt_robot_os.link.client']),
    'settings': ('Settings', ['rt_robot_os.settings', 'rt_robot_os.settings.model']),
    'common': ('Errors, reports, units', ['rt_robot_os.base.errors', 'rt_robot_os.base.reports',
                                          'rt_robot_os.base.units']),
}

# Their classes inherit what runs with each job and each message; not what Python's own give.
INHERITING = dict.fromkeys(('topics', 'kernel'), 'ABC, Enum, Exception, Protocol, int, tuple')

CONF = """\
project = 'rt_robot_os'
author = copyright = 'The rt_robot_os authors'
extensions = ['sphinx.ext.autodoc', 'sphinx.ext.viewcode']
autodoc_default_options = {'members': True, 'show-inheritance': True}
autodoc_member_order = 'bysource'
autodoc_typehints = 'signature'
html_theme = 'alabaster'
html_theme_options = {'page_width': '1100px'}
"""

INDEX = """\
rt_robot_os
===========

The API reference, made from the docstrings. Guides and tutorials are in ``docs``.

.. toctree::
   :maxdepth: 2

"""


def write_sources(folder: Path) -> None:
    """Write what Sphinx reads: a page for each part of the API."""
    (folder / 'conf.py').write_text(CONF)
    (folder / 'index.rst').write_text(INDEX + ''.join(f'   {page}\n' for page in PAGES))
    for page, (title, modules) in PAGES.items():
        parts = [f'{title}\n{"=" * len(title)}\n']
        for module in modules:
            found = importlib.import_module(module)
            names = '   :imported-members:\n' if hasattr(found, '__all__') else ''
            if page in INHERITING:
                names += f'   :inherited-members: {INHERITING[page]}\n'
            parts.append(f'{module}\n{"-" * len(module)}\n\n.. automodule:: {module}\n{names}')
        (folder / f'{page}.rst').write_text('\n'.join(parts))


def main() -> int:
    """Make it; the exit code is 1 when Sphinx warned, 2 when it is missing."""
    parser = argparse.ArgumentParser(description='Make the API reference from the docstrings.')
    parser.add_argument('--out', type=Path, default=ROOT / 'build' / 'api',
                        help='folder of the pages (default: build/api)')
    arguments = parser.parse_args()
    if importlib.util.find_spec('sphinx') is None:
        print(f'api_reference: Sphinx is missing: {sys.executable} -m pip install sphinx',
              file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix='api-') as name:
        write_sources(Path(name))
        done = subprocess.run([sys.executable, '-m', 'sphinx', '-q', '-W', '--keep-going', '-b',
                               'html', '-d', f'{name}/doctrees', name, str(arguments.out)],
                              env={**os.environ, SWITCH: '0'})  # the C core has short docstrings
    if done.returncode == 0:
        print(f'{arguments.out / "index.html"}')
    return 1 if done.returncode else 0


if __name__ == '__main__':
    sys.path.insert(0, str(ROOT))
    sys.exit(main())
