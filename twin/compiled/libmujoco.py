"""MuJoCo's own shared library, callable from compiled code."""

from pathlib import Path

import llvmlite.binding
import mujoco
from numba import types

_candidates = sorted(
    file
    for pattern in ("libmujoco.so.*", "libmujoco*.dylib", "mujoco.dll")
    for file in Path(mujoco.__file__).parent.glob(pattern)
)
if not _candidates:
    raise ImportError(f"{Path(mujoco.__file__).parent}: holds no MuJoCo library")
llvmlite.binding.load_library_permanently(str(_candidates[0]))

# Addresses of MjModel and MjData go in as integers: unlike a ctypes pointer, that caches.
mj_step1 = types.ExternalFunction("mj_step1", types.void(types.intp, types.intp))
mj_step2 = types.ExternalFunction("mj_step2", types.void(types.intp, types.intp))
# int mju_eig3(eigval[3], eigvec[9], quat[4], mat[9]): eigenvalues of a symmetric 3x3 matrix.
mju_eig3 = types.ExternalFunction(
    "mju_eig3", types.int32(types.intp, types.intp, types.intp, types.intp)
)
