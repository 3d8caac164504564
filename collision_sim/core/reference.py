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
Values that compiled code is handed by reference: one word in place of a hundred.

A kernel that is handed a tuple of arrays is handed every word of it, and so is each kernel that it
calls: that takes long to compile, and some time to run. A Reference is the address of the words.
Its attributes are those of the value. It lives as long as the object that `refer` returns.
"""

from collision_sim.core.jit import law
from llvmlite import ir
from numba import config, typeof, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (infer_getattr, intrinsic, lower_getattr_generic, models, NativeValue,
                             register_jitable, register_model, typeof_impl, unbox)
from numba.np.arrayobj import make_array
import numpy as np

ROOM = 512              # words of a value, at most

_kinds = {}             # Numba's types of References, by the `_key` of their values


def _key(value):
    """Return what the type of a value depends on."""
    if isinstance(value, np.ndarray):
        flags = value.flags
        return value.dtype, value.ndim, flags.c_contiguous, flags.f_contiguous, flags.writeable
    if isinstance(value, tuple):
        return type(value), *map(_key, value)
    return getattr(value, '_numba_type_', type(value))


if config.DISABLE_JIT:
    def refer(value, store=None):
        """Return the value itself, which plain Python hands over just as well."""
        return value

    def refer_here(value):
        """Return the value itself."""
        return value

    def put(words, value):
        """Return how many words a value takes: none."""
        return 0
else:
    class Reference:
        """
        A named tuple and the address of its words; its attributes are those of the tuple.

        Attributes
        ----------
        value : NamedTuple
        address : int

        """

        def __init__(self, value, store=None):
            self.value = value
            self._words = np.zeros(ROOM, dtype=np.int64)
            size = store(self._words, *value) if store else _store(self._words, value)
            if size > ROOM:
                raise TypeError(f'{type(value).__name__} takes more than {ROOM} words: {size}')
            self.address = self._words.ctypes.data

        @property
        def _numba_type_(self):
            """Numba's type, where Numba looks for it; to find it anew takes up to 0.7 ms."""
            if '_kind' not in self.__dict__:
                key = _key(self.value)
                if key not in _kinds:
                    _kinds[key] = ReferenceType(typeof(self.value))
                self._kind = _kinds[key]
            return self._kind

        def __getattr__(self, name):
            """Return an attribute of the value."""
            if name.startswith('_') or name in ('value', 'address'):
                raise AttributeError(name)
            return getattr(self.value, name)

        def __reduce__(self):
            """Copy the value; the copy has words of its own."""
            return refer, (self.value,)

        def _replace(self, **fields):
            return refer(self.value._replace(**fields))

    def refer(value, store=None):
        """
        Return a Reference to a value.

        Parameters
        ----------
        value : NamedTuple
            Of numbers, arrays and tuples of these.
        store : callable, optional
            A law that does what `put` does, handed the words and each field by itself: Numba finds
            the type of a tuple with References in it in 0.5 ms, and theirs in 2 us.

        Returns
        -------
        Reference

        """
        return Reference(value, store)

    class ReferenceType(types.Type):
        """Numba's type of a Reference; it `refers`, so it can be handed over by address."""

        refers = True

        def __init__(self, to):
            self.to = to
            super().__init__(name=f'Reference({to})')

    @typeof_impl.register(Reference)
    def _typeof(value, context):
        return ReferenceType(typeof_impl(value.value, context))

    @register_model(ReferenceType)
    class ReferenceModel(models.PrimitiveModel):
        """A Reference is the pointer to the words."""

        def __init__(self, manager, kind):
            super().__init__(manager, kind, manager[kind.to].get_data_type().as_pointer())

    @unbox(ReferenceType)
    def _unbox(kind, reference, c):
        number = c.pyapi.object_getattr_string(reference, 'address')
        address = c.pyapi.long_as_longlong(number)
        c.pyapi.decref(number)
        return NativeValue(c.builder.inttoptr(address, c.context.get_value_type(kind)))

    @infer_getattr
    class ReferenceAttribute(AttributeTemplate):
        """An attribute has the type that it has in the value."""

        key = ReferenceType

        def generic_resolve(self, kind, name):
            """Return the type of an attribute."""
            if name in kind.to.fields:
                return kind.to[kind.to.fields.index(name)]

    @lower_getattr_generic(ReferenceType)
    def _attribute(context, builder, kind, pointer, name):
        number = kind.to.fields.index(name)
        place = cgutils.gep_inbounds(builder, pointer, 0, number)
        return context.data_model_manager[kind.to[number]].load_from_data_pointer(builder, place)

    def _unowned(context, builder, kind, value):
        """Return a value whose arrays do not say who owns them: the Reference does."""
        if isinstance(kind, types.Array):
            array = make_array(kind)(context, builder, value)
            array.meminfo, array.parent = (cgutils.get_null_value(owner.type)
                                           for owner in (array.meminfo, array.parent))
            return array._getvalue()
        if isinstance(kind, types.BaseTuple):
            for k, part in enumerate(kind):
                own = _unowned(context, builder, part, builder.extract_value(value, k))
                value = builder.insert_value(value, own, k)
        return value

    @intrinsic
    def _size(typing_context, value):
        def generate(context, builder, signature, arguments):
            kind = context.data_model_manager[value].get_data_type()
            return ir.IntType(64)(context.get_abi_sizeof(kind))
        return types.int64(value), generate

    @intrinsic
    def _put(typing_context, words, value):
        def generate(context, builder, signature, arguments):
            model = context.data_model_manager[value]
            data = make_array(words)(context, builder, arguments[0]).data
            place = builder.bitcast(data, model.get_data_type().as_pointer())
            own = _unowned(context, builder, value, arguments[1])
            builder.store(model.as_data(builder, own), place)
            return context.get_dummy_value()
        return types.none(words, value), generate

    @intrinsic
    def refer_here(typing_context, value):
        """Return a Reference to a value, for kernels called by the entry that asks for it."""
        def generate(context, builder, signature, arguments):
            model = context.data_model_manager[value]
            own = _unowned(context, builder, value, arguments[0])
            return cgutils.alloca_once_value(builder, model.as_data(builder, own))
        return ReferenceType(value)(value), generate

    @law
    def _store(words, value):
        """Write a value to its words, if it takes no more; return how many it takes."""
        return put(words, value)

    @register_jitable
    def put(words, value):
        """Write a value to words, if it takes no more than these; return how many it takes."""
        size = (_size(value) + 7) // 8
        if size <= words.shape[0]:
            _put(words, value)
        return size
