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

"""
Runs of a sweep on a Dask cluster.

Scenes go there by value, with what was in their files. When a worker dies, the scheduler gives
its runs to others, as often as its setting `distributed.scheduler.allowed-failures` says.
"""

from importlib.util import find_spec
from itertools import islice
import logging
import re
import warnings

from collision_sim.checks import SceneError
from collision_sim.studies.outcomes import failure, version

PATIENCE = 30           # s; for the scheduler to answer, and for the first worker
ADDRESS = re.compile(r'((tcp|tls|wss?)://)?[^/\s]+:\d{1,5}')
AHEAD = 2               # runs for each thread of the cluster that are on their way to it


def require(address):
    """Refuse what is no address, and any where dask.distributed is not installed."""
    if not ADDRESS.fullmatch(address):
        raise SceneError('--scheduler', address, 'must be like tcp://host:8786')
    if find_spec('distributed') is None:
        raise SceneError('--scheduler', address,
                         "needs dask.distributed: pip install 'collision_sim[sweep]'")


class Cluster:
    """
    The workers of a Dask scheduler.

    Parameters
    ----------
    address : str
        Of the scheduler, such as tcp://host:8786.

    Raises
    ------
    SceneError
        For an address of unknown form, no workers, or workers with another version.
    OSError
        Where no scheduler answers.

    """

    def __init__(self, address):
        require(address)
        from distributed import Client
        logging.getLogger('distributed.client').setLevel(logging.CRITICAL)   # it raises, too
        self._address = address
        self._client = Client(address, timeout=PATIENCE, set_as_default=False)
        try:
            self._check()
        except BaseException:
            self._client.close()
            raise

    def _check(self):
        """Refuse a cluster without workers, or one that would run something else."""
        try:
            self._client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise SceneError('--scheduler', self._address, 'must have a worker; start one with: '
                             f'dask worker {self._address}') from None
        versions = self._client.run(version, on_error='return')
        try:
            versions[self._address] = self._client.run_on_scheduler(version)
        except Exception as error:      # whatever its environment raises
            versions[self._address] = failure(error)
        for address, found in versions.items():
            if found != version():
                raise SceneError('--scheduler', self._address,
                                 'must be of a cluster with the same collision_sim as here, '
                                 f'{version()}; {address} has: {found}')

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._client.close()

    def each(self, function, calls):
        """
        Call a function for each of some arguments, as processes.Pool.each.

        Raises
        ------
        OSError
            Where the scheduler is lost, or something else but the death of workers is wrong.

        """
        from distributed import as_completed, CancelledError, KilledWorker
        keys, calls = {}, iter(calls)
        ended = as_completed(loop=self._client.loop)
        self._submit(function, calls, keys, ended)
        for future in ended:
            result, reason = None, ''
            try:
                result = future.result()
            except KilledWorker as error:
                reason = failure(error)
            except CancelledError:
                raise OSError(f'{self._address}: the scheduler does not answer any more') from None
            except Exception as error:      # the function itself raises nothing
                raise OSError(f'{self._address}: {failure(error)}') from None
            yield keys.pop(future.key), result, reason
            self._submit(function, calls, keys, ended)

    def _submit(self, function, calls, keys, ended):
        """Send as many calls as the cluster, as it is now, has use for."""
        threads = sum(self._client.nthreads().values())
        for key, args in islice(calls, max(AHEAD * max(threads, 1) - len(keys), 0)):
            with warnings.catch_warnings():
                warnings.filterwarnings('ignore', 'Sending large graph')
                future = self._client.submit(function, *args, pure=False)
            keys[future.key] = key
            ended.add(future)
