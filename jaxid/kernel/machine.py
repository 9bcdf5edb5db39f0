"""Machine code for this processor, as a call target of XLA's programs.

XLA calls a function of C with one argument, the call frame of its foreign-function interface, whose layout is that of the
header `xla/ffi/api/c_api.h` which jaxlib ships. The function is written here in LLVM instructions, too, so that no compiler
is needed.
"""

import ctypes
import hashlib
import os
import re
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import jax
import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

from .._atomic import replacing
from .._kept import folder
from .emit import DOUBLE, INDEX, Builder, Value

_MAJOR, _MINOR = 0, 3
"""Version of the interface whose layout this is."""
_EXTENSIONS, _ARGUMENTS, _RESULTS = 8, 72, 112
"""Bytes behind the start of a call frame: first extension, arguments, results."""
_EXTENSION_TYPE, _NEXT, _METADATA, _VERSION = 8, 16, 24, (24, 28)
_METADATA_TYPE = 1
"""`XLA_FFI_Extension_Metadata`; a handler leaves extensions of other types alone."""
_BUFFER_DATA, _BUFFER_SHAPE = 24, 40


@cache
def _effort() -> int:
    """How much LLVM optimises while it selects instructions, 0 to 3: as much as XLA, by its own flag, else what suffices.

    Rollouts written with 1 run as fast as with 2 and 3, and 1.5 to 3 times as fast as with 0.
    """
    asked = re.search(r"--xla_backend_optimization_level=(\d)", os.environ.get("XLA_FLAGS", ""))
    return min(int(asked[1]), 3) if asked else 1


def new_machine() -> llvm.TargetMachine:
    """This processor, as LLVM describes it."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple()
    features = llvm.get_host_cpu_features().flatten()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=_effort(), jit=True)


@cache
def _machine() -> llvm.TargetMachine:
    """To translate with. An engine takes one of its own, which it deletes with itself."""
    return new_machine()


@cache
def lanes() -> int:
    """Double-precision numbers in a vector register of this processor."""
    features = llvm.get_host_cpu_features()
    return 8 if features.get("avx512f") else 4


def _at(build: Builder, base: Value, offset: int, kind: ir.Type) -> Value:
    """What stands `offset` bytes behind `base`."""
    return build.load(build.bitcast(build.gep(base, [ir.Constant(INDEX, offset)]), kind.as_pointer()))


def write_handler(
    module: ir.Module, sizes: Sequence[tuple[int, int]], arguments: int, results: int = 1, *, function: str = "rollout"
) -> None:
    """Add `handler(frame)`, which calls the module's `function` with `sizes` and the data of the frame's arrays.

    `sizes`: (argument, axis) whose length is passed on, in order.
    """
    byte = ir.IntType(8)
    pointer, number = byte.as_pointer(), ir.IntType(32)
    handler = ir.Function(module, ir.FunctionType(pointer, [pointer]), "handler")
    (frame,) = handler.args
    build: Builder = ir.IRBuilder(handler.append_basic_block("entry"))
    nothing = ir.Constant(pointer, None)
    look, check, answer, other, work = (
        handler.append_basic_block(name) for name in ("look", "check", "answer", "other", "work")
    )
    first = _at(build, frame, _EXTENSIONS, pointer)
    entry = build.block
    build.branch(look)
    build.position_at_end(look)
    extension = build.phi(pointer)
    extension.add_incoming(first, entry)
    build.cbranch(build.icmp_unsigned("==", extension, nothing), work, check)
    build.position_at_end(check)
    kind = _at(build, extension, _EXTENSION_TYPE, number)
    build.cbranch(build.icmp_unsigned("==", kind, ir.Constant(number, _METADATA_TYPE)), answer, other)
    build.position_at_end(other)
    extension.add_incoming(_at(build, extension, _NEXT, pointer), other)
    build.branch(look)
    # XLA asks for the version of the interface before it calls.
    build.position_at_end(answer)
    metadata = _at(build, extension, _METADATA, pointer)
    for offset, value in zip(_VERSION, (_MAJOR, _MINOR), strict=True):
        address = build.bitcast(build.gep(metadata, [ir.Constant(INDEX, offset)]), number.as_pointer())
        build.store(ir.Constant(number, value), address)
    build.ret(nothing)
    build.position_at_end(work)
    given, wanted = (_at(build, frame, offset, pointer) for offset in (_ARGUMENTS, _RESULTS))
    buffers = [_at(build, given, 8 * i, pointer) for i in range(arguments)]
    outputs = [_at(build, wanted, 8 * i, pointer) for i in range(results)]
    lengths = []
    for argument, axis in sizes:
        shape = _at(build, buffers[argument], _BUFFER_SHAPE, pointer)
        lengths.append(_at(build, shape, 8 * axis, INDEX))
    data = [_at(build, buffer, _BUFFER_DATA, DOUBLE.as_pointer()) for buffer in (*buffers, *outputs)]
    build.call(module.globals[function], [*lengths, *data])
    build.ret(nothing)


_lock = threading.Lock()
_engines: dict[str, llvm.ExecutionEngine] = {}
_registered: set[str] = set()
_REVISION = "3"
"""To be raised where the same instructions shall be compiled differently."""


def _translated(text: str, rewrite: bool) -> bytes:
    """Object code of a module, its instructions rewritten before or as they are."""
    parsed = llvm.parse_assembly(text)
    if rewrite and _effort() > 0:
        tuning = llvm.create_pipeline_tuning_options(speed_level=2)
        tuning.loop_vectorization = tuning.slp_vectorization = False  # the vectors are written out
        passes = llvm.create_pass_builder(_machine(), tuning)
        passes.getModulePassManager().run(parsed, passes)
    return _machine().emit_object(parsed)


def _path(name: str) -> Path | None:
    kept = folder()
    return None if kept is None else kept / f"{name}.code"


def _stored(name: str, text: str, rewrite: bool) -> bytes:
    """Object code of a module, kept with the user's compiled programs."""
    path = _path(name)
    if path is None:
        return _translated(text, rewrite)
    code = _read(path)
    if code is None:
        code = _translated(text, rewrite)
        # A cache that cannot be written does no harm.
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with replacing(path) as temporary:
                temporary.write_bytes(_digest(code) + code)
    return code


def _digest(code: bytes) -> bytes:
    return hashlib.sha256(code).digest()


def _read(path: Path) -> bytes | None:
    """Kept object code, behind its digest; None where there is none, or not the whole of it (LLVM crashes on a part)."""
    try:
        kept = path.read_bytes()
    except OSError:
        return None
    size = hashlib.sha256().digest_size
    digest, code = kept[:size], kept[size:]
    return code if digest == _digest(code) else None


@cache
def machine_words() -> tuple[str, ...]:
    """What object code depends on besides its instructions."""
    host = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return tuple(map(str, (_REVISION, _effort(), *llvm.llvm_version_info, *host)))


def _load(name: str, code: bytes) -> None:
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), new_machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _engines[name] = engine  # its code lives as long as it does


def loaded(module: ir.Module, rewrite: bool = False) -> str:
    """Compile `module` for this processor, unless it has been; its name here.

    `rewrite`: let LLVM simplify the instructions first. Expressions stand once already, and nothing runs faster for it, but
    loops over matrices do, twice as fast.
    """
    text = str(module)
    key = "\n".join([*machine_words(), text])
    name = f"jaxid_{hashlib.sha256(key.encode()).hexdigest()[:32]}"
    with _lock:
        if name not in _engines:
            _load(name, _stored(name, text, rewrite))
    return name


def loaded_again(name: str) -> bool:
    """Load what was compiled under this name before; whether it is there."""
    with _lock:
        path = _path(name)
        if name not in _engines and path is not None:
            code = _read(path)
            if code is not None:
                _load(name, code)
        return name in _engines


def function(name: str, symbol: str, sizes: int, arrays: int) -> Callable[..., None]:
    """A function of a loaded module, which takes so many sizes and then so many contiguous NumPy arrays of doubles."""
    kinds = [ctypes.c_int64] * sizes + [ctypes.c_void_p] * arrays
    call = ctypes.CFUNCTYPE(None, *kinds)(_engines[name].get_function_address(symbol))

    def checked(*given: Any) -> None:
        call(*given[:sizes], *map(_address, given[sizes:]))

    return checked


_DOUBLES = np.dtype(np.float64)


def _address(array: np.ndarray) -> int:
    if array.dtype != _DOUBLES or not array.flags.c_contiguous:
        raise TypeError("machine code takes contiguous arrays of doubles")
    return array.__array_interface__["data"][0]


def register(name: str) -> str:
    """Let XLA's programs call the `handler` of a loaded module by its name."""
    with _lock:
        if name not in _registered:
            handler = _capsule(_engines[name].get_function_address("handler"))
            jax.ffi.register_ffi_target(name, handler, platform="cpu")
            _registered.add(name)
    return name


def _capsule(address: int) -> object:
    """A C function's address as Python passes it on."""
    new = ctypes.pythonapi.PyCapsule_New
    new.restype, new.argtypes = ctypes.py_object, (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    return new(address, None, None)
