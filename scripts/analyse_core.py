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
Analyse the C core without running it: ``gcc -fanalyzer``, cppcheck, clang-tidy.

    .venv/bin/python scripts/analyse_core.py

A finding is printed as the tool says it, and is an exit code of 1; a tool that is missing is named
with how to install it, and an exit code of 2.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

from core_build import C_SOURCES
from core_build import include_folder
from core_build import ROOT

SOURCES = [f'rt_robot_os/{name}' for name in C_SOURCES]
COMMON = ['-std=c11', '-DPy_LIMITED_API=0x030B0000', '-DRT_ROBOT_OS_SOURCES=""']
# Of clang-tidy: what crashes or leaks, not style.
CHECKS = ('-*,bugprone-*,clang-analyzer-*,cert-*-c,-bugprone-easily-swappable-parameters,'
          # Flags are chars, which hold 0 and 1.
          '-bugprone-narrowing-conversions,-bugprone-signed-char-misuse,-cert-str34-c,'
          '-clang-analyzer-security.insecureAPI.DeprecatedOrUnsafeBufferHandling')


def commands() -> dict[str, list[str]]:
    """Return the command of each tool."""
    include = include_folder()
    return {
        'gcc': ['gcc', '-fanalyzer', '-O2', '-Wall', '-Wextra', '-Wshadow', '-Wconversion',
                '-Wno-sign-conversion', '-Werror', '-c', '-o', os.devnull, *COMMON,
                f'-isystem{include}'],
        'cppcheck': ['cppcheck', '--enable=warning,performance,portability', '--quiet',
                     '--error-exitcode=1', '--inline-suppr', '--library=python',
                     '--suppress=missingInclude', *COMMON[1:], '--std=c11', '--language=c'],
        'clang-tidy': ['clang-tidy', '--quiet', f'--checks={CHECKS}', '--warnings-as-errors=*'],
    }


def main() -> int:
    """Run the tools."""
    status = 0
    for name, command in commands().items():
        if shutil.which(command[0]) is None:
            print(f'{name} is not here: sudo apt install {name}')
            status = status or 2
            continue
        for source in SOURCES:
            after = []
            if name == 'clang-tidy':
                after = ['--', *COMMON, f'-isystem{include_folder()}']
            done = subprocess.run([*command, source, *after], cwd=ROOT, text=True,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
            if done.returncode:
                status = 1
                print(f'{name} {source}:\n{done.stdout}', flush=True)
        print(f'{name}: done', flush=True)
    return status


if __name__ == '__main__':
    sys.exit(main())
