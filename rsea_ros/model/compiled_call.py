"""Call a compiled effect through its address: one indirect call, about two nanoseconds."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


@intrinsic
def call(typingctx: Any, address: Any, s: Any, p: Any, x: Any) -> Any:
    """Call `void f(double*, double*, double*)` at an address with three addresses, all given as integers."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double_pointer = ir.DoubleType().as_pointer()
        function = ir.FunctionType(ir.VoidType(), [double_pointer] * 3).as_pointer()
        target = builder.inttoptr(arguments[0], function)
        builder.call(target, [builder.inttoptr(a, double_pointer) for a in arguments[1:]])
        return context.get_dummy_value()

    return types.void(types.intp, types.intp, types.intp, types.intp), generate
