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

"""The kernels of a simulation whose scene changes: which are there, and what has to wait."""

from collision_sim.ros.warm_up import variant, WarmUp


class Kernels:
    """
    Keeps a WarmUp for each variant of a scene that has been asked for; the first one at once.

    Parameters
    ----------
    scene : Scene
        As it is at the start.
    ledger : bool
        Whether accounts of energy are kept.
    contacts : bool
        Whether kernels that record contacts are needed first.

    Attributes
    ----------
    start : WarmUp
        That of the scene at the start.

    """

    def __init__(self, scene, ledger, contacts):
        """Begin with those of the scene."""
        self._ledger = ledger
        self._scene, self._variant = scene, variant(scene)
        self.start = WarmUp(scene, ledger, contacts)
        self._found = {self._variant: self.start}

    def adopt(self, scene, contacts):
        """
        Use the kernels of another scene if they are ready, else see to it that they will be.

        Parameters
        ----------
        scene : Scene
            That of before with other values.
        contacts : bool
            Whether kernels that record contacts are needed first.

        Returns
        -------
        ready : bool
            Whether its steps can be taken without compiling anything.

        """
        wanted = variant(scene)
        if wanted not in self._found:
            self._found[wanted] = WarmUp(scene, self._ledger, contacts, beside=True)
        if wanted != self._variant and not self._found[wanted].ready:
            return False
        self._scene, self._variant = scene, wanted
        return True

    def ready(self, contacts):
        """Whether there are kernels for the scene that record contacts, or do not."""
        return self._found[self._variant].seconds[contacts].done()

    @property
    def all_done(self):
        """Whether nothing is on its way."""
        return all(each.done for each in self._found.values())

    @property
    def compiles(self):
        """Whether something that is on its way had to be compiled."""
        return any(each.compiles for each in self._found.values() if not each.done)

    @property
    def failure(self):
        """What kept kernels from being ready, an exception; None as a rule."""
        return next(filter(None, (each.failure for each in self._found.values())), None)

    def wait(self):
        """Do not go on before all are ready; raises what kept them from it."""
        for each in list(self._found.values()):
            for future in each.seconds.values():
                future.result()
