"""Records whose stamps scatter, put on even clocks before anything else is made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rsea_ros.identification.even_stamps import Evened, even_out, may_be_even
from rsea_ros.identification.fit import fit
from rsea_ros.identification.problem import case_from
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import BoolArray, Record


def with_even_clocks(
    records: Sequence[Record], masked: Sequence[Mapping[str, BoolArray]], rig: Rig
) -> Evened:
    """Return records on the even clocks that a fit of the rig prefers; as they are where no stamps scatter.

    masked: samples that do not count, by channel, of each record.
    """
    steady = Evened(tuple(records), {})
    if is_inverse(rig) or not any(may_be_even(record) for record in records):
        return steady
    while True:
        cases = [case_from(r, rig, bad) for r, bad in zip(steady.records, masked, strict=True)]
        more = even_out(steady.records, rig, fit(cases, rig)[0])
        if not more.scatter:
            return steady
        steady = Evened(more.records, {**steady.scatter, **more.scatter})
