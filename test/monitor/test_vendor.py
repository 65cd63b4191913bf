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

"""Check that what the page brings from elsewhere is what its makers published."""

from __future__ import annotations

import hashlib
from pathlib import Path

VENDOR = Path(__file__).resolve().parents[2] / 'rt_robot_os/monitor/page/vendor'


def test_every_library_of_the_page_is_unchanged() -> None:
    libraries = [each for each in VENDOR.iterdir() if each.is_dir()]
    assert libraries
    for library in libraries:
        lines = (library / 'VERSION.txt').read_text().splitlines()
        expected = {name: digest for digest, name in (line.split() for line in lines
                                                      if not line.startswith('#'))}
        files = {each.name: hashlib.sha256(each.read_bytes()).hexdigest()
                 for each in library.iterdir() if each.name != 'VERSION.txt'}
        assert files == expected, library.name


def test_every_library_of_the_page_brings_its_licence() -> None:
    for library in VENDOR.iterdir():
        assert 'Permission is hereby granted' in (library / 'LICENSE.txt').read_text()
