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

"""The error responses of the REST interface: always a text and a remedy."""

from __future__ import annotations

from fastapi import HTTPException
from rt_robot_os.base.errors import StoreError


def refusal(status: int, text: str, remedy: str) -> HTTPException:
    """
    Make the response to a request that cannot be served.

    :param text: the error.
    :param remedy: advice for the user.
    """
    return HTTPException(status, {'text': text, 'remedy': remedy})


def unknown(what: str) -> HTTPException:
    """
    Make the response for an object that does not exist or is not visible to the user.

    Both cases get the same response, so that a user learns nothing about hidden objects.
    """
    return refusal(404, f'there is no such {what}', 'look at the list of those that you may see')


def away(error: StoreError) -> HTTPException:
    """Make the response for an unavailable database."""
    return refusal(503, f'the database cannot be used now: {error}',
                   'try again in a moment; what is live goes on')
