"""A handler as XLA calls it: call frames laid out by hand after `xla/ffi/api/c_api.h`, with and without extensions."""

import ctypes
from ctypes import POINTER, c_double, c_int, c_int64, c_size_t, c_uint32, c_void_p, pointer

import llvmlite.binding as llvm
import pytest
from llvmlite import ir

from jaxid.kernel.emit import DOUBLE, INDEX
from jaxid.kernel.machine import new_machine, write_handler

UNKNOWN, METADATA = 7, 1


class Version(ctypes.Structure):
    _fields_ = [("size", c_size_t), ("extension", c_void_p), ("major", c_int), ("minor", c_int)]


class Metadata(ctypes.Structure):
    _fields_ = [("size", c_size_t), ("version", Version), ("traits", c_uint32), ("state", c_int64)]


class Extension(ctypes.Structure):
    pass


Extension._fields_ = [
    ("size", c_size_t), ("kind", c_int), ("following", POINTER(Extension)), ("metadata", POINTER(Metadata))
]  # fmt: skip


class Buffer(ctypes.Structure):
    _fields_ = [("size", c_size_t), ("extension", c_void_p), ("dtype", c_int), ("data", POINTER(c_double)),
                ("rank", c_int64), ("dims", POINTER(c_int64))]  # fmt: skip


class Buffers(ctypes.Structure):
    _fields_ = [("size", c_size_t), ("extension", c_void_p), ("count", c_int64), ("types", c_void_p),
                ("each", POINTER(POINTER(Buffer)))]  # fmt: skip


class Frame(ctypes.Structure):
    _fields_ = [("size", c_size_t), ("extension", POINTER(Extension)), ("api", c_void_p), ("context", c_void_p),
                ("stage", c_int), ("arguments", Buffers), ("results", Buffers)]  # fmt: skip


def buffers(values):
    """One array of numbers, as arguments or results."""
    data = (c_double * len(values))(*values)
    buffer = Buffer(data=data, rank=1, dims=pointer(c_int64(len(values))))
    return Buffers(count=1, each=(POINTER(Buffer) * 1)(pointer(buffer))), data


@pytest.fixture(scope="module")
def handler():
    """A handler around a `rollout` that writes its first number times its length."""
    module = ir.Module("handled")
    numbers = DOUBLE.as_pointer()
    rollout = ir.Function(module, ir.FunctionType(ir.VoidType(), [INDEX, numbers, numbers]), "rollout")
    build = ir.IRBuilder(rollout.append_basic_block())
    length, given, wanted = rollout.args
    build.store(build.fmul(build.load(given), build.sitofp(length, DOUBLE)), wanted)
    build.ret_void()
    write_handler(module, [(0, 0)], arguments=1)
    machine = new_machine()  # also makes LLVM ready
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(str(module)), machine)
    engine.finalize_object()
    yield ctypes.CFUNCTYPE(c_void_p, POINTER(Frame))(engine.get_function_address("handler"))
    engine.close()


def called(handler, *kinds):
    """The result and the version written, of a call with extensions of these kinds."""
    metadata, following = Metadata(), POINTER(Extension)()
    for kind in reversed(kinds):
        following = pointer(Extension(kind=kind, following=following, metadata=pointer(metadata)))
    (arguments, given), (results, result) = buffers([2.5, 0.0, 0.0]), buffers([0.0])
    assert handler(Frame(extension=following, arguments=arguments, results=results)) is None and given[0] == 2.5
    return result[0], (metadata.version.major, metadata.version.minor)


@pytest.mark.parametrize("kinds", [(), (UNKNOWN,), (UNKNOWN, UNKNOWN)])
def test_extensions_that_it_does_not_know_keep_a_handler_from_nothing(handler, kinds):
    assert called(handler, *kinds) == (7.5, (0, 0))


@pytest.mark.parametrize("kinds", [(METADATA,), (UNKNOWN, METADATA), (METADATA, UNKNOWN)])
def test_a_question_for_the_version_is_answered_and_nothing_is_computed(handler, kinds):
    assert called(handler, *kinds) == (0.0, (0, 3))
