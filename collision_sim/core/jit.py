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
How functions of the core are compiled: `formula` for what people call, `kernel` for the rest.

All are cached on disk and follow IEEE 754 (no fast-math), so that vector and scalar code agree to
the last bit. They allocate nothing, so they count no references (`_nrt`). A `law` is a formula
that people also call with arrays, which it then allocates; an `entry` is where the simulation
comes in, and holds no lock of the interpreter.
A kernel is called from compiled code only. Without a Python entry it compiles in half the time;
optimised and turned into machine code by its callers alone, as a part of them, in three quarters
of that. An `inlined` kernel is part of its caller for good, which saves handing over a hundred
words of tables: those with a single caller are, and the smallest. The rest LLVM decides on; to
inline whatever an inlined kernel calls, as Numba would, takes five times as long to compile where
there are meshes, and gains nothing. Measured, a particle that slides on a plane: 720 ns, without
reference counts 330, with inlining 110. A `counted` kernel makes arrays, so it counts references.
An entry keeps its kernels to itself, which takes a third off scenes with meshes.
What only some scenes need is compiled by itself and called by its address (`open_kernel` and
`by_address`; modules.py).
NUMBA_DISABLE_JIT=1 turns all of them into plain Python.
"""

from contextlib import suppress
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
import pickle

from collision_sim.core.interrupts import aside
from collision_sim.core.stamps import stamp
from llvmlite import binding, ir
from numba import config, njit, typeof, types
from numba.core import cgutils
from numba.core.caching import FunctionCache, IndexDataCacheFile, NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import TypingError
from numba.core.runtime.nrt import rtsys
from numba.extending import intrinsic
from numba.np.arrayobj import make_array


class PartLibrary(JITCodeLibrary):
    """
    Code of a kernel, for its callers to link.

    Numba would optimise it and make machine code of it, which nobody calls: callers link and
    optimise the whole. Only its environment, which Numba asks for by name, is made.
    """

    def _optimize_final_module(self):
        """Leave that to the callers."""

    def _finalize_final_module(self):
        """Keep the code to be linked, and go on with the environment alone."""
        code, empty = self._final_module, self._codegen._create_empty_module(self.name)
        for function in code.functions:
            if not function.is_declaration and function.linkage == binding.Linkage.external:
                function.linkage = 'linkonce_odr'       # several callers may link it
        self._shared_module = code
        environment = [str(variable) for variable in code.global_variables
                       if 'NumbaEnv' in variable.name]
        self._final_module = binding.parse_assembly('\n'.join([str(empty), *environment]))
        super()._finalize_final_module()


class EntryLibrary(JITCodeLibrary):
    """
    Code of an entry, with that of all kernels it uses.

    Nobody else calls this copy of theirs, so LLVM may leave out what they are handed for nothing:
    an array is handed over as eight words, of which most kernels use one or two. They are private,
    not internal: by its name the linker of the JIT would find them for callers elsewhere, too.
    """

    def _optimize_final_module(self):
        """Optimise, once it is known that nobody else calls the kernels."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == binding.Linkage.linkonce_odr:
                function.linkage = 'private'
        super()._optimize_final_module()


def _compiler_into(library):
    """Give Numba's pipeline into a library of a class."""
    class Into(Compiler):

        def define_pipelines(self):
            """Give the passes, once it is known what they work on."""
            state = self.state
            state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
            return super().define_pipelines()
    return Into


# What is not said here is as in the function whose call compiles this one first.
LAW = {'error_model': 'numpy', 'forceinline': False}
FORMULA = {**LAW, '_nrt': False}
ENTRY = {**LAW, 'nogil': True, 'pipeline_class': _compiler_into(EntryLibrary)}
KERNEL = {**FORMULA, 'no_cpython_wrapper': True, 'no_cfunc_wrapper': True,
          'pipeline_class': _compiler_into(PartLibrary)}


class KernelFiles(IndexDataCacheFile):
    """
    The files of a cached function, an index and one for each signature.

    Each begins with a digest of what follows: what a full disk has cut, or anything has changed,
    counts as absent. Numba would end with whatever that makes pickle raise, or run it.

    Parameters
    ----------
    path, base : str
        Folder, and what the names of the files begin with.
    stamp : callable
        Gives the digest of what the function is made from; called when that is asked for.

    """

    def __init__(self, path, base, stamp):
        super().__init__(path, base, b'')
        self._stamp = stamp

    def _save_index(self, overloads):
        self._write(self._index_path, (self._version, self._stamp(), overloads))

    def _load_index(self):
        found = self._read(self._index_path)
        if found is None or found[:2] != (self._version, self._stamp()):
            return {}
        return found[2]

    def _save_data(self, name, data):
        self._write(self._data_path(name), data)

    def _load_data(self, name):
        return self._read(self._data_path(name))

    def _write(self, path, value):
        """Write a value to a file, which is there whole or not at all."""
        content = self._dump(value)
        with self._open_for_write(path) as file:
            file.write(sha256(content).digest())
            file.write(content)

    def _read(self, path):
        """Return the value of a file, None where there is none that is whole."""
        try:
            stored = Path(path).read_bytes()
        except OSError:
            return None
        digest, content = stored[:DIGEST], stored[DIGEST:]
        if sha256(content).digest() == digest:
            with suppress(Exception):       # of a type that only another program knows
                return pickle.loads(content)
        return None


class KernelCache(FunctionCache):
    """
    Numba's cache of compiled functions, as the core needs it.

    Numba takes a function from its cache as long as the file it is in stays the same. What it
    calls may be in another file, of a newer version by now: here all that is compiled into it has
    to be the same, and nothing else (stamps.py). And it begins with all it needs to compile, a
    third of a second, before it looks whether anything has to be: here that waits until something
    has. Where a function cannot be read or kept, it is compiled, and nothing is said.

    Attributes
    ----------
    lost : int
        How many functions could not be kept, of all caches.

    """

    lost = 0

    def __init__(self, function, options):
        super().__init__(function)
        line = f'-{function.__code__.co_firstlineno}.'      # changes with what is above it
        base = '-0.'.join(self._impl.filename_base.rsplit(line, 1))
        self._cache_file = KernelFiles(self._cache_path, base, cache(partial(
            stamp, function, options)))

    def load_overload(self, sig, target_context):
        """Give what is stored for a signature, or None: then it will be compiled."""
        rtsys.initialize(target_context)
        try:
            stored = self._load_overload(sig, target_context)
        except Exception:       # whatever Numba makes of what another machine has written
            stored = None
        if stored is None:
            target_context.refresh()
        return stored

    def save_overload(self, sig, data):
        """Keep what was compiled for a signature, where there is a place for it."""
        try:
            self._save_overload(sig, data)
        except OSError:
            KernelCache.lost += 1


def _cache_of(function, options):
    """Give the cache of a function; none where no folder for it can be written to."""
    try:
        return KernelCache(function, options)
    except (OSError, RuntimeError):
        return NullCache()


def _compiled(options):
    """Give the decorator for functions that are compiled with these options."""
    def decorate(function):
        dispatcher = njit(**options)(function)
        if not config.DISABLE_JIT:
            dispatcher._cache = _cache_of(function, options)
            dispatcher.get_call_template = partial(_call_template, dispatcher.get_call_template)
            dispatcher.compile = partial(_compile, dispatcher.compile)
        return dispatcher
    return decorate


def _call_template(template_of, args, keywords):
    """Return how a function is called; with constants as with other values, not once more."""
    return template_of(tuple(types.unliteral(arg) for arg in args),
                       {name: types.unliteral(arg) for name, arg in keywords.items()})


def _compile(compile_here, signature):
    """
    Compile a function for a signature, beside the main thread.

    What is compiled on the way to a function of someone else's stays in its thread, which has the
    lock of the compiler.
    """
    if global_compiler_lock.is_locked():
        return compile_here(signature)
    return aside(compile_here, signature)


DIGEST = sha256().digest_size
WORD = 64               # bits
law = _compiled(LAW)
formula = _compiled(FORMULA)
entry = _compiled(ENTRY)
kernel = _compiled(KERNEL)
inlined = _compiled({**KERNEL, 'forceinline': True})
counted = _compiled({**KERNEL, '_nrt': True})


def bound(function, *args):
    """
    Give the machine code of an entry for arguments of these types, compiled if need be.

    Finding out the types takes longer than a step of a few particles; who calls again and again
    with the same ones does it once. What is there already does not wait for other threads that
    compile.
    """
    if not hasattr(function, 'compile'):
        return function
    signature = tuple(typeof(arg) for arg in args)
    found = function.overloads.get(signature)
    return found.entry_point if found else function.compile(signature)


if config.DISABLE_JIT:
    def open_kernel(modules, number, function, like, args):
        """Do nothing: plain Python calls functions by their names."""

    def by_address(modules, number, function, like, args):
        """Call a function."""
        return function(*args)

    def widest_vectors():
        """Do nothing: there are no vector instructions."""

    def prefetch(array, index):
        """Do nothing: there is no hurry."""

    def select(condition, a, b):
        """Give a where the condition holds, else b."""
        return a if condition else b

    def ordered(x):
        """Give the number itself, which compares as it is."""
        return x

    def number_of(key):
        """Give it back."""
        return key

    def not_clear(array, index):
        """Give the entries from an index on that are negative or NaN, as WORD bits."""
        return sum((not array[index + k] >= 0.0) << k for k in range(WORD))

    def lowest(bits):
        """Give the number of the lowest bit that is set; there is one."""
        return (int(bits) & -int(bits)).bit_length() - 1
else:
    def _handed(value):
        """
        Return the type of what is handed to or by a function that is called by its address.

        Integers and floats have 64 bits, and arrays are contiguous.
        """
        if isinstance(value, types.BaseTuple):
            parts = [_handed(part) for part in value]
            return types.BaseTuple.from_types(parts, getattr(value, 'instance_class', None))
        plain, numbers = types.unliteral(value), (types.int64, types.float64, types.boolean)
        whole = isinstance(plain, types.Array) and plain.layout == 'C' and plain.mutable
        if not whole and plain not in numbers and not getattr(plain, 'refers', False):
            raise TypingError(f'{value} cannot be handed to a function by its address')
        return plain

    def _kind(result, handed):
        """Return a number for the types that a function returns and is handed."""
        digest = sha256(f'{result} {handed}'.encode()).digest()
        return ir.IntType(WORD)(int.from_bytes(digest[:8], 'little', signed=True))

    def _place_in(context, builder, modules_type, modules, number, column):
        """Return the pointer to a column of a row of the modules."""
        array, zero = make_array(modules_type)(context, builder, modules), ir.IntType(WORD)
        return cgutils.get_item_pointer(context, builder, modules_type, array,
                                        [number, zero(column)], wraparound=False)

    @intrinsic
    def open_kernel(typing_context, modules, number, function, like, args):
        """
        Write the address of a kernel, valid in this process, to a row of the modules.

        Parameters
        ----------
        typing_context
            Numba's own; nobody hands it over.
        modules : (M, 2) int64
            Addresses, and what stands for the types that the kernel is compiled for.
        number : int
            Which row.
        function : function
            The kernel.
        like
            A value of the type that it returns.
        args : tuple
            Values of the types that it is handed.

        """
        handed, result = _handed(args), _handed(like)
        called = function.get_call_type(typing_context, tuple(handed), {})
        if types.unliteral(called.return_type) != result:
            raise TypingError(f'{function} returns {called.return_type}, not {result}')

        def generate(context, builder, signature, arguments):
            implementation = context.get_function(function, called)
            context.add_linking_libs(getattr(implementation, 'libs', ()))
            compiled = function.dispatcher.overloads[called.args]
            declared = context.declare_function(builder.module, compiled.fndesc)
            address = builder.ptrtoint(declared, ir.IntType(WORD))
            for column, value in enumerate((address, _kind(result, handed))):
                place = _place_in(context, builder, modules, *arguments[:2], column)
                builder.store(value, place)
            return context.get_dummy_value()
        return types.none(modules, types.int64, function, result, handed), generate

    @intrinsic
    def by_address(typing_context, modules, number, function, like, args):
        """
        Call the kernel at an address that `open_kernel` has written.

        The caller is compiled without it, and it without the caller. A call takes some 10 ns.

        Parameters
        ----------
        typing_context, modules, number
            As of `open_kernel`.
        function : function
            The kernel; in plain Python it is called, compiled code calls the address.
        like
            A value of the type that it returns.
        args : tuple
            What it is handed.

        Returns
        -------
        value
            What it returns.

        Raises
        ------
        RuntimeError
            If it is not open for these types.

        """
        handed, result = _handed(args), _handed(like)
        parts, name = tuple(handed), function.dispatcher.py_func.__name__

        def generate(context, builder, signature, arguments):
            address, kind = (builder.load(_place_in(context, builder, modules, *arguments[:2],
                                                    column)) for column in range(2))
            closed = builder.icmp_signed('!=', kind, _kind(result, handed))
            with builder.if_then(closed, likely=False):
                context.call_conv.return_user_exc(
                    builder, RuntimeError, (f'{name} is not open for what it is handed',))
            called = context.call_conv.get_function_type(result, parts)
            place = builder.inttoptr(address, called.as_pointer())
            values = cgutils.unpack_tuple(builder, arguments[4], len(parts))
            _, value = context.call_conv.call_function(builder, place, result, parts, values)
            return value
        return result(modules, types.int64, function, result, handed), generate

    @intrinsic
    def widest_vectors(typing_context):
        """
        Let LLVM use vectors of 512 bit in the calling function, where the processor has them.

        For Intel it prefers 256 bit, which the loops over blocks take up to a third longer with.
        llvmlite passes attributes on as they are, but refuses to add one that it does not know.
        """
        def generate(context, builder, signature, arguments):
            set.add(builder.function.attributes, '"prefer-vector-width"="512"')
            return context.get_dummy_value()
        return types.none(), generate

    @intrinsic
    def prefetch(typing_context, array, index):
        """
        Ask for the cache line of an entry of an array that will soon be read and written.

        Entries are counted as they lie in memory, whatever the shape; the index may be beyond the
        array: nothing is read.
        """
        def generate(context, builder, signature, arguments):
            entries = make_array(signature.args[0])(context, builder, arguments[0])
            place = builder.gep(entries.data, [arguments[1]])
            flag = ir.IntType(32)
            function = cgutils.get_or_insert_function(
                builder.module, ir.FunctionType(ir.VoidType(), [place.type, flag, flag, flag]),
                'llvm.prefetch.p0')
            write, soon, data = 0, 2, 1
            builder.call(function, [place, flag(write), flag(soon), flag(data)])
            return context.get_dummy_value()
        return types.none(array, types.intp), generate

    @intrinsic
    def select(typing_context, condition, a, b):
        """
        Give a where the condition holds, else b; both are worked out, without a branch.

        Of `x[i] = a if c else x[i]` LLVM makes a store under a mask, which takes AMD several times
        as long as one without.
        """
        def generate(context, builder, signature, arguments):
            return builder.select(*arguments)
        return types.float64(types.boolean, types.float64, types.float64), generate

    def _flipped(builder, bits):
        """Give the bits of a number without its sign flipped where it is negative."""
        word, sign = ir.IntType(WORD), WORD - 1
        below = word((1 << sign) - 1)
        return builder.xor(bits, builder.and_(builder.ashr(bits, word(sign)), below))

    @intrinsic
    def ordered(typing_context, x):
        """
        Give an int64 that compares with others as the number does; NaN is beyond the infinities.

        Of a search for the smallest or largest integer LLVM makes vectors; of one for a number
        it does not, since the order of the search would matter to NaN.
        """
        def generate(context, builder, signature, arguments):
            return _flipped(builder, builder.bitcast(arguments[0], ir.IntType(WORD)))
        return types.int64(types.float64), generate

    @intrinsic
    def number_of(typing_context, key):
        """Give the number that is ordered by a key."""
        def generate(context, builder, signature, arguments):
            return builder.bitcast(_flipped(builder, arguments[0]), ir.DoubleType())
        return types.float64(types.int64), generate

    @intrinsic
    def not_clear(typing_context, array, index):
        """Give the entries from an index on that are negative or NaN, as WORD bits."""
        def generate(context, builder, signature, arguments):
            entries = make_array(signature.args[0])(context, builder, arguments[0])
            place = cgutils.get_item_pointer(context, builder, signature.args[0], entries,
                                             [arguments[1]], wraparound=False)
            many = ir.VectorType(ir.DoubleType(), WORD)
            loaded = builder.load(builder.bitcast(place, many.as_pointer()), align=8)
            return builder.bitcast(builder.fcmp_unordered('<', loaded, many(None)),
                                   ir.IntType(WORD))
        return types.uint64(array, types.intp), generate

    @intrinsic
    def lowest(typing_context, bits):
        """Give the number of the lowest bit that is set; there is one."""
        def generate(context, builder, signature, arguments):
            return builder.cttz(arguments[0], ir.IntType(1)(1))
        return types.int64(types.uint64), generate
