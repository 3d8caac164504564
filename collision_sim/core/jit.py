# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0
# SPDX-License-Identifier: Apache-2.0
"""
How functions of the core are compiled: `formula` for what people call, `kernel` for the rest.

Both are cached on disk and follow IEEE 754 (no fast-math), so that vector and scalar code agree
to the last bit. They allocate nothing, so they count no references (`_nrt`), which would cost more
than the physics of a contact: 720 against 330 ns, measured. A kernel is called from compiled code
only: leaving out its Python entry nearly halves the time to compile a step. NUMBA_DISABLE_JIT=1
turns both into plain Python.
"""

from numba import njit

OPTIONS = {'cache': True, 'error_model': 'numpy', '_nrt': False}

formula = njit(**OPTIONS)
kernel = njit(**OPTIONS, no_cpython_wrapper=True, no_cfunc_wrapper=True)
