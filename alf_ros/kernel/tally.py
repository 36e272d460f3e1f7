"""The call of the ledger, where there is one: its code is reached through an address."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

# what is noted of a stage: all of it; or, where it is interpolated, first what does not depend on
# reactions, and then what does, place by place
ALL, APPLIED, REACTING = np.int64(0), np.int64(1), np.int64(2)


@intrinsic
def tally(
    typing: Any,
    ledger: Any,
    system: Any,
    forces: Any,
    work: Any,
    phase: Any,
    t: Any,
    s: Any,
    weight: Any,
    part: Any,
) -> Any:
    """Note the power of each effect at stage s, as it stands in `work`, `weight` times; `part`:
    ALL, APPLIED or REACTING. Past the last stage: the step, `weight` (s) long, counts.

    ledger: `Ledger.tally`. Without an address in it nothing is done; to ask for it here, and not
    in code of its own, saves a second of compiling.
    """

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = cgutils.create_struct_proxy(sig.args[0])(context, builder, value=args[0])
        with builder.if_then(builder.icmp_unsigned('!=', at.size, at.size.type(0))):
            values = list(args[1:])
            kind = ir.FunctionType(ir.VoidType(), [value.type for value in values])
            builder.call(builder.inttoptr(builder.load(at.data), kind.as_pointer()), values)
        return context.get_dummy_value()

    number = types.float64
    return types.void(
        ledger, system, forces, work, phase, t, types.uint64, number, types.int64
    ), code
