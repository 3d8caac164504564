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

from collision_sim.checks import SceneError
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter

LISTS = 'parameters', 'names', 'prefixes'       # fields of requests


def error_text(error):
    """Say in one line what was raised."""
    return '%s: %s' % (type(error).__name__, error)


def answering(kind, callback, log_error, most, set_each):
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
    most : callable
        Gives how many values or names a request may have.
    set_each : callable
        Sets parameters one by one, and gives what became of each.

    """
    def refuse(reason, count=1):
        log_error(reason)
        return _refusal(kind, reason, count)

    def answer(request, response):
        try:
            return callback(request, response)
        except SceneError as error:
            return _refusal(kind, str(error))
        except Exception as error:
            return refuse(error_text(error))

    def answer_each(request, response):
        results, readable = {}, {}
        for k, message in enumerate(request.parameters):
            try:
                readable[k] = Parameter.from_parameter_msg(message)
            except Exception as error:
                results[k], = refuse(error_text(error)).results
        results |= zip(readable, set_each(list(readable.values())))
        response.results = [results[k] for k in range(len(request.parameters))]
        return response

    def answer_few(request, response):
        count = max((len(getattr(request, name, ())) for name in LISTS))
        if count > most():
            return refuse('%d in one request, at most %d are taken' % (count, most()), count)
        return answer(request, response)

    if kind is SetParameters:
        callback = answer_each
    return answer_few


def _refusal(kind, reason, count=1):
    """Response that says why; an empty one where it has no field for that."""
    response, refused = kind.Response(), SetParametersResult(successful=False, reason=reason)
    if kind is SetParameters:
        response.results = count * [refused]
    elif kind is SetParametersAtomically:
        response.result = refused
    elif hasattr(response, 'success'):
        response.success, response.message = False, reason
    return response
