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

"""Friction as a scene gives it, and how it is read; the laws are in core/laws.py."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from collision_sim.checks import Choice, join, Number, read_leaves, read_section, SceneError


WET_FORMS = ('exponential', 'capped', 'linear')

FRICTION = {
    'dry': Number('', 'Dry friction', low=0),
    'dry.static': Number('', 'Dry friction at rest', low=0),
    'dry.kinetic': Number('', 'Dry friction while sliding', low=0),
    'wet': Number('s/m', 'Wet friction', low=0),
}


@dataclass(frozen=True)
class Friction:
    """
    Friction of a collider with particles; nothing given is no friction.

    Attributes
    ----------
    static, kinetic : float or None [-]
        Dry friction, static >= kinetic; both None without it.
    wet : float or None [s/m]
        Wet friction; None without it.
    wet_form : str
        One of WET_FORMS.
    apart : bool
        Static and kinetic were given apart, so they are two parameters.

    """

    static: float | None = None
    kinetic: float | None = None
    wet: float | None = None
    wet_form: str = WET_FORMS[0]
    apart: bool = False


def read_friction(value, path) -> Friction | None:
    """Read friction; None where there is nothing, Friction() where there is none on purpose."""
    if value is None:
        return None
    if isinstance(value, str) and value == 'none':
        return Friction()
    if not isinstance(value, Mapping) or not value:
        raise SceneError(path, value, 'must be none or a mapping with dry, wet or both')
    section = read_section(value, path, ('dry', 'wet'))
    friction = Friction()
    if 'dry' in section:
        friction = _with_dry(friction, section['dry'], join(path, 'dry'))
    if 'wet' in section:
        friction = _with_wet(friction, section['wet'], join(path, 'wet'))
    return friction


def _with_dry(friction, value, path):
    """Add dry friction: one coefficient, or static and kinetic apart."""
    if not isinstance(value, Mapping):
        coefficient = FRICTION['dry'].read(value, path)
        return replace(friction, static=coefficient, kinetic=coefficient)
    leaves = {key: FRICTION[f'dry.{key}'] for key in ('static', 'kinetic')}
    section = read_section(value, path, leaves)
    friction = replace(friction, **read_leaves(section, path, leaves, required=leaves), apart=True)
    return _checked_dry(friction, value, path)


def _with_wet(friction, value, path):
    """Add wet friction: one coefficient, or coefficient and form."""
    if not isinstance(value, Mapping):
        return replace(friction, wet=FRICTION['wet'].read(value, path))
    leaves = {'coefficient': FRICTION['wet'], 'form': Choice(WET_FORMS)}
    section = read_section(value, path, leaves)
    found = read_leaves(section, path, leaves, required=('coefficient',))
    return replace(friction, wet=found['coefficient'],
                   wet_form=found.get('form', friction.wet_form))


def with_friction(friction, keys, value, path):
    """Change one coefficient; a static or kinetic one that stands alone sets both."""
    coefficient = FRICTION['.'.join(keys)].read(value, path)
    if keys == ['wet']:
        return replace(friction, wet=coefficient)
    if keys == ['dry'] or friction.static is None:
        friction = replace(friction, static=coefficient, kinetic=coefficient)
    if keys != ['dry']:
        friction = replace(friction, apart=True, **{keys[1]: coefficient})
    return _checked_dry(friction, value, path)


def _checked_dry(friction, value, path):
    if friction.static < friction.kinetic:
        raise SceneError(path, value, 'static friction must be at least the kinetic one '
                                      f'({friction.static:g} < {friction.kinetic:g})')
    return friction


def friction_parameters(friction, path):
    """Give the coefficients that are there, by their paths."""
    values = {'wet': friction.wet}
    if friction.apart:
        values |= {'dry.static': friction.static, 'dry.kinetic': friction.kinetic}
    else:
        values['dry'] = friction.static
    return {f'{path}.{key}': leaf.parameter(values[key])
            for key, leaf in FRICTION.items() if values.get(key) is not None}
