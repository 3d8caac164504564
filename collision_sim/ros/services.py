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

"""Every request gets an answer, also one that the node cannot make sense of."""

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically


def error_text(error):
    """Say in one line what was raised."""
    return '%s: %s' % (type(error).__name__, error)


def answering(kind, callback, log_error):
    """
    Give a callback of a service that answers where another one raises; a caller waits no longer.

    Parameters
    ----------
    kind : type
        Of the service. Parameters that are set one by one are also refused one by one.
    callback : callable
        Takes request and response, and gives the response.
    log_error : callable
        Takes the text of what was raised.

    """
    def answer(request, response):
        try:
            return callback(request, response)
        except Exception as error:
            reason = error_text(error)
            log_error(reason)
            return _refusal(kind, reason)

    def answer_each(request, response):
        for parameter in request.parameters:
            one = answer(kind.Request(parameters=[parameter]), kind.Response())
            response.results.extend(one.results)
        return response

    return answer_each if kind is SetParameters else answer


def _refusal(kind, reason):
    """Response that says why; an empty one where it has no field for that."""
    response, refused = kind.Response(), SetParametersResult(successful=False, reason=reason)
    if kind is SetParameters:
        response.results = [refused]
    elif kind is SetParametersAtomically:
        response.result = refused
    elif hasattr(response, 'success'):
        response.success, response.message = False, reason
    return response
