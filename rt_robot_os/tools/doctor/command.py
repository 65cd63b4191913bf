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

"""What the program `doctor` does with its command line."""

from __future__ import annotations

from collections.abc import Sequence
import io
import sys

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.programs import INTERRUPTED
from rt_robot_os.base.programs import warn
from rt_robot_os.tools.doctor.examination import Doctor
from rt_robot_os.tools.doctor.options import parse
from rt_robot_os.tools.doctor.report import FAILED
from rt_robot_os.tools.doctor.system import System


def run(argv: Sequence[str]) -> int:
    """
    Run the program.

    :return: its exit code, see ``--help``.
    :raises BrokenPipeError: its output is no longer read.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A name that the terminal cannot show is no reason to print nothing.
        sys.stdout.reconfigure(errors='backslashreplace')
    try:
        options, wanted = parse(argv)
        return Doctor(System(wanted), options).run().verdict.value
    except ConfigError as error:
        warn('doctor', 'the configuration is wrong, nothing was checked:', error.problems)
        return FAILED
    except KeyboardInterrupt:
        print('\ndoctor: interrupted', file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        raise
    except Exception as error:
        warn('doctor', f'failed, please report it: {type(error).__name__}: {error}')
        return FAILED
