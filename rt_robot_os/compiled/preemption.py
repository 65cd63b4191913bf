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

"""Where compiled code lets an alarm through; not compiled itself, for that is what it takes."""


def preemption_point() -> None:
    """
    Let an alarm that has come be served, as between any two lines of interpreted code.

    The handlers of signals run when CPython begins to interpret a function, and never inside of
    compiled code. To be called by compiled code that loops for longer than some 50 us; takes 0.05.
    """
